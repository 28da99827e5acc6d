"""The first screen of a report: questions by method, and a few sentences, all derived from the runs."""
import math
from collections import Counter
from dataclasses import replace

from ..draw.work_precision import ACCURACIES, cheapest, costs_of
from ..grade import metrics
from ..grade.limits import STEP_KEYS
from ..grade.numbers import Number, number_of
from ..grade.targets import NOT_CONVERGING_ORDER, graded, number
from ..read.number_tables import DEFAULTS
from .names import figure_anchor, figure_names, study_anchor
from .question import BY_METHOD, Question, about_of, by_variant, marks
from .slopes import slopes_of


def is_static(run):
    """Whether a run is one static solve, which is another task than a motion that is damped until it rests."""
    return run.result is not None and run.result.method == "fem" and run.result.performance.get("steps", 2) <= 1


def lasting(costs, runs, accuracy):
    """The settings from whose cell size on, to finer ones, the best error of each size that ran is at most `accuracy`: a lucky size is none, nor
    is one below which the method fails."""
    kept = []
    for size in sorted({run.values.get("L") or 0 for run in runs}):
        own = [c for c in costs if (c.L or 0) == size]
        if min((c.error for c in own), default=math.inf) > accuracy:
            break
        kept += own
    return kept


def is_elastic(run):
    """Whether a run of FEM, which is elastic, stands among those of soil that fails."""
    return run.result is not None and run.result.method == "fem" and any(m.get("law") == "mohr_coulomb" for m in run.result.resolved.get("material", []))


def _reaches(study):
    """Questions for the seconds to an accuracy: of the figures of error against time whose norm is graded, else of the first."""
    names = dict(zip(map(id, study.spec.figures), figure_names(study)))
    figures = [f for f in study.spec.figures if f["kind"] == "work_precision" and f.get("x", "solve_s") == "solve_s" and f.get("y", "error") == "error"
               and ("exact" in f or metrics.is_error(f["quantity"], f.get("norm", "")))]
    figures = [f for f in figures if (f["quantity"], f.get("norm", "")) in graded(study) or "exact" in f] or figures[:1]
    found = []
    for entry in figures:
        quantity, norm = entry["quantity"], entry.get("norm", "")
        about = about_of(study, entry["where"], quantity, norm)
        every = by_variant(study.select(entry["where"]))
        costs = {v: [c for c in costs_of(runs, entry, study.plan.get("cores"))[0] if not any(run.suspect for run in c.runs)] for v, runs in every.items()}
        for accuracy in ACCURACIES:
            question = Question(f"Seconds to {100 * accuracy:g} %: {about}", about, f"{100 * accuracy:g} %", figure_anchor(names[id(entry)]))
            for variant, own in costs.items():
                best = cheapest(lasting(own, every[variant], accuracy), accuracy)
                if best is None:
                    question.cells[variant] = "missing" if all(run.result is None for run in every[variant]) else "not reached"
                    continue
                question.cells[variant] = Number(number(best.solve_s, 2) + (" busy" if best.busy else "") + (" †" if is_static(best.runs[0]) else ""), (best.solve_s,), study.name, "solve_s",
                                                 "", "median", [r.id for r in best.runs])
            times = {v: c.values[0] for v, c in question.cells.items() if isinstance(c, Number) and not c.text.endswith(("†", "busy"))}
            question.best = [v for v, t in times.items() if t == min(times.values())]
            found.append(question)
    return found


def _values(study):
    """Questions for what is measured where nothing converges: the quantities of targets on values, of every method."""
    found = {}
    for target in study.spec.targets:
        quantity, norm = target["quantity"], target.get("norm", "")
        where = {k: v for k, v in target["where"].items() if k not in BY_METHOD}
        if not target["kind"].startswith("value") or quantity == "static":
            continue
        about = about_of(study, where, quantity, norm)
        question = Question(about[:1].upper() + about[1:], about, "value", study_anchor(study))
        for variant, runs in by_variant(study.select(where)).items():
            made = number_of(study, {**DEFAULTS, "quantity": quantity, "norm": norm, "where": {**where, "variant": variant}})
            if quantity != "modulus" and any(map(is_elastic, runs)):
                question.cells[variant] = "elastic"
            elif made.values:
                question.cells[variant] = replace(made, text=made.text + marks(runs, [run for run in runs if run.id in made.runs]))
            elif any(not run.completed for run in runs):
                question.cells[variant] = next(run.status for run in runs if not run.completed)
        if question.cells:
            found[quantity, norm, str(where)] = question
    return list(found.values())


def _limits(study):
    """Questions for what a search has found that is no time step, such as a factor of safety."""
    found = {}
    for limit in study.limits:
        if limit.key in STEP_KEYS or limit.below is None:
            continue
        axes = ", ".join(f"{k.rsplit('.', 1)[-1]} {v:g}" if isinstance(v, float) else f"{k.rsplit('.', 1)[-1]} {v}" for k, v in limit.axes.items()
                         if k not in BY_METHOD)
        about = f"{study.case(limit.case).title}, {axes}"
        question = found.setdefault(about, Question(f"Largest {limit.key.rsplit('.', 1)[-1]} that holds: {about}", about, "limit",
                                                    f"{study_anchor(study)}-case-{limit.case}"))
        low = limit.measured[0]
        question.cells[limit.below.name] = Number(number(low, 4), (low,), study.name, "limit", "measured", "every", [limit.below.id])
    return list(found.values())


def _failures(studies):
    """The question how many runs diverged or are suspect."""
    question = Question("Runs that failed or are suspect, of all", "", "failures", "failures")
    every = by_variant([run for study in studies if not study.spec.cases for run in study.runs])
    for variant, runs in every.items():
        bad = sum(run.suspect or not run.completed for run in runs)
        question.cells[variant] = f"{bad} of {len(runs)}"
    clean = [v for v, runs in every.items() if not any(run.suspect or not run.completed for run in runs)]
    question.best = clean if len(clean) < len(every) else []
    return question


def questions(studies):
    """All rows of the matrix."""
    plain = [study for study in studies if not study.spec.cases]
    slopes, reaches = {s.folder: slopes_of(s) for s in plain}, {s.folder: _reaches(s) for s in plain}
    rows = [q for found in (slopes, reaches) for study in plain for q in found[study.folder]]
    rows += [q for study in plain if not slopes[study.folder] and not reaches[study.folder] for q in _values(study)]
    rows += [q for study in studies if study.spec.cases for q in _limits(study)]
    return rows + ([_failures(plain)] if any(study.runs for study in plain) else [])


def _listed(names):
    names = list(names)
    return ", ".join(names[:-1]) + " and " + names[-1] if len(names) > 1 else "".join(names)


def _behind(question):
    """How far behind the second is."""
    timed = sorted((c for c in question.cells.values() if isinstance(c, Number) and not c.text.endswith(("†", "busy"))), key=lambda c: c.values[0])
    if len(timed) < 2:
        return []
    first, second = timed[:2]
    ratio = second.values[0] / first.values[0]
    return [", the next ", replace(second, text=f"{ratio:.2g}", values=(ratio,), over=first.runs), " times that"]


def _fastest(rows):
    """Who reaches each accuracy first."""
    said = []
    for goal in dict.fromkeys(q.goal for q in rows if q.goal.endswith("%")):
        asked = [q for q in rows if q.goal == goal and q.best]
        if not asked:
            continue
        wins = Counter(v for q in asked for v in q.best)
        parts = []
        for variant, _ in wins.most_common():
            own = [q for q in asked if variant in q.best]
            parts += [". " if parts else "", f"{variant} in {len(own)} ("]
            for k, q in enumerate(own):
                parts += ["; " if k else "", q.about + ": ", q.cells[variant], " s", *_behind(q)]
            parts.append(")")
        variants = dict.fromkeys(v for q in asked for v in q.cells)
        never = [v for v in variants if all(q.cells.get(v, "not reached") == "not reached" for q in asked)]
        parts += [f". Never there: {_listed(never)}"] if never else []
        said.append([f"First to an error of {goal}, in {len(asked)} comparison{'s' if len(asked) > 1 else ''}: ", *parts, "."])
    return said


def _orders(rows):
    """Who converges best, and who does not."""
    asked = [q for q in rows if q.goal == "order" and q.best]
    if not asked:
        return []
    wins = Counter(v for q in asked for v in q.best)
    parts = [f"Highest order of convergence (within 0.05), in {len(asked)} comparison{'s' if len(asked) > 1 else ''}: "
             + ", ".join(f"{v} {n} times" if n > 1 else f"{v} once" for v, n in wins.most_common()) + "."]
    flat = [(v, q) for q in asked for v, c in q.cells.items() if isinstance(c, Number) and c.values[0] < NOT_CONVERGING_ORDER]
    if flat:
        parts.append(f" No convergence (order below {NOT_CONVERGING_ORDER:g}): ")
        for k, variant in enumerate(dict.fromkeys(v for v, _ in flat)):
            parts += [". " if k else "", variant + " ("]
            for j, q in enumerate(q for v, q in flat if v == variant):
                parts += ["; " if j else "", q.about + ": ", q.cells[variant]]
            parts.append(")")
        parts.append(".")
    return [parts]


def _spread(rows):
    """Exponents: one sentence for each."""
    return [part for q in rows if q.goal == "exponent" for part in [[
        f"Exponent of L in {q.about}: ", *[p for k, (v, c) in enumerate(q.cells.items()) for p in (", " if k else "", f"{v} ", c)], "."]]]


def _codes(run):
    return [line.split(":")[0] for line in run.result.suspect] if run.result is not None else []


def _failing(studies):
    """What fails where, and why the guards say it does."""
    runs = [(study, run) for study in studies if not study.spec.cases for run in study.runs]
    failed = [(s, r) for s, r in runs if not r.completed]
    suspect = [(s, r) for s, r in runs if r.suspect]
    if not failed and not suspect:
        return [[f"All {len(runs)} runs completed, and no guard found one suspect."]] if runs else []
    said = f"Of {len(runs)} runs {len(failed)} did not complete or are missing and {len(suspect)} are suspect"
    by = []
    for variant in dict.fromkeys(r.name for _, r in failed + suspect):
        own = [(s, r) for s, r in failed + suspect if r.name == variant]
        where = ", ".join(f"{n} in {name}" for name, n in Counter(r.values.get("case") or s.name for s, r in own).most_common(4))
        why = Counter(code for _, r in own for code in ([r.status] if not r.completed else _codes(r)))
        by.append(f"{variant} {len(own)} ({where}: {', '.join(code for code, _ in why.most_common(3))})")
    return [[f"{said}: {'; '.join(by)}."]]


def _static(studies):
    """Static solves are another task than motion."""
    found = {}
    for study in studies:
        if not any(f["kind"] == "work_precision" for f in study.spec.figures):
            continue
        for run in study.runs:
            if run.completed and is_static(run):
                found.setdefault(run.name, {})[run.values.get("case") or study.name] = True
    if not found:
        return []
    cases = dict.fromkeys(case for own in found.values() for case in own)
    return [[f"Not comparable in seconds (†): {_listed(found)} solve {_listed(cases)} once, as statics, where the other methods damp a motion until it rests."]]


def _claimed(claims):
    """Which claims do not hold as they stand."""
    refuted = [claim.name for claim in claims if claim.verdict == "refuted"]
    half = [claim.name for claim in claims if claim.verdict == "holds only if"]
    parts = ([f"Refuted by these runs: {'; '.join(refuted)}."] if refuted else []) + ([f"Holding only under a condition: {'; '.join(half)}."] if half else [])
    return [[" ".join(parts)]] if parts else []


def sentences(studies, rows, claims):
    """Three to six sentences as lists of strings and Numbers."""
    return [*_fastest(rows), *_orders(rows), *_spread(rows)[:2], *_claimed(claims), *_failing(studies), *_static(studies)]


def compared(studies):
    """What was compared, on what, in one line."""
    runs = [run for study in studies for run in study.runs]
    variants = dict.fromkeys(run.name for run in runs)
    cases = dict.fromkeys(run.values.get("case") or "" for run in runs)
    sizes = sorted({run.values["L"] for run in runs if isinstance(run.values.get("L"), float)})
    span = f", L from {sizes[-1]:g} to {sizes[0]:g} m" if len(sizes) > 1 else ""
    return f"{_listed(variants)} on {len(cases)} case{'s' if len(cases) != 1 else ''} of {len(studies)} stud{'ies' if len(studies) != 1 else 'y'}: {len(runs)} runs{span}."
