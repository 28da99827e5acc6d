"""The nearest known name, for messages about unknown ones."""
from difflib import get_close_matches


def did_you_mean(name, known):
    """', did you mean ...?' or the list of known names."""
    known = [str(k) for k in known]
    near = get_close_matches(str(name), known, n=1, cutoff=0.5)
    return f", did you mean '{near[0]}'?" if near else f" (known: {', '.join(sorted(known))})"
