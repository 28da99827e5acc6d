"""What all groups of metrics share."""


class MetricError(Exception):
    """A group that cannot be computed: says what lacks."""


def need(numbers, key, group):
    """A number of report.reference."""
    if key not in numbers:
        raise MetricError(f"'{group}' lacks report.reference.{key}")
    return numbers[key]


def nonzero(value, what):
    """A positive scale."""
    if not value > 0:
        raise MetricError(f"{what} is zero: nothing to scale an error with")
    return value
