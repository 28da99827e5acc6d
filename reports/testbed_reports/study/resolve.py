"""What combinations mean to the solver: scenes as `testbed check` resolves them."""
import shlex
import subprocess
import tomllib
from dataclasses import replace

from ..grade.scene_words import of_scene
from ..read.study_file import StudyError, same, toml_value


def _constants_of(scene):
    """Names of the constants of a scene file; what is wrong with it `testbed check` tells."""
    try:
        constants = tomllib.loads(scene.read_text(encoding="utf-8")).get("constants", {})
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return set()
    return {f"constants.{name}" for name in constants} if isinstance(constants, dict) else set()


def with_own_constants(combinations, every):
    """Where scenes are an axis, a constant is set in those that have it. One that no scene of `every` combination has is left to be refused."""
    known = {scene: _constants_of(scene) for scene in {c.scene for c in every}}
    anywhere = set().union(*known.values())
    return [replace(c, sets={k: v for k, v in c.sets.items() if k not in anywhere - known[c.scene]}) if "scene" in c.axes else c
            for c in combinations]


def run_arguments(combination):
    """Arguments that choose scene, method and settings, for `run` and `check` alike."""
    arguments = [str(combination.scene)]
    if combination.method:
        arguments += ["--method", combination.method]
    for key, value in combination.sets.items():
        arguments += ["--set", f"{key}={toml_value(value)}"]
    return arguments


class Refused(StudyError):
    """A combination that `testbed check` refuses."""

    def __init__(self, combination, told):
        self.scene, self.told, self.arguments = combination.scene, told, shlex.join(run_arguments(combination)[1:])
        super().__init__(told)


def refusals(refused):
    """One message for all combinations that are refused with the same words."""
    texts = []
    for key in dict.fromkeys((r.scene, r.told) for r in refused):
        alike = [r for r in refused if (r.scene, r.told) == key]
        more = f" and {len(alike) - 1} more combinations" if len(alike) > 1 else ""
        texts.append(f"{key[0]}: refused by 'testbed check' ({alike[0].arguments}){more}:\n{key[1]}")
    return "\n".join(texts)


def refuse_twins(study, chosen, scenes):
    """Values of axes that never make another scene of a scene file would stand side by side as if they differed. That two meet somewhere is
    lawful."""
    seen, texts, twins = {}, {}, []
    for (combination, method), (text, _) in zip(chosen, scenes):
        texts[combination.case, repr(combination.axes)] = (combination.axes, text)
        key = (combination.case, method, combination.threads, text)
        if key in seen:
            twins.append((seen[key], combination))
        seen.setdefault(key, combination)
    for first, second in twins:
        change = {k: v for k, v in second.axes.items() if not same(v, first.axes.get(k))}
        pairs = ((text, texts.get((case, repr({**axes, **change})), (axes, text))[1]) for (case, _), (axes, text) in texts.items()
                 if case == first.case and axes.get("scene") == first.axes.get("scene") and all(same(axes.get(k), first.axes.get(k)) for k in change))
        if all(other == text for text, other in pairs):
            told = ", ".join(f"{k} = {first.axes.get(k)} and {v}" for k, v in change.items())
            raise StudyError(f"{study.path}: {told} are the same scene: an axis has no effect")


def refuse_misspelt(study, chosen, scenes):
    """A name in a scene's [report] that is another one misspelt would be left out of the grades without a word."""
    told = [f"{combination.scene}: {text}" for (combination, _), (_, resolved) in zip(chosen, scenes) for text in of_scene(resolved, study.figures)[0]]
    if told:
        raise StudyError("\n".join(dict.fromkeys(told)))


def resolve(testbed, combination):
    """The resolved scene of a combination as TOML text."""
    done = subprocess.run([str(testbed), "check", *run_arguments(combination), "--resolved"],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace")
    if done.returncode != 0:
        raise Refused(combination, done.stderr.strip() or done.stdout.strip() or f"exit code {done.returncode}")
    try:
        return done.stdout, tomllib.loads(done.stdout)
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{combination.scene}: 'testbed check --resolved' did not print TOML: {error}") from error


def method_of(scene):
    """The method that a scene file names, '' if none."""
    try:
        return str(tomllib.loads(scene.read_text(encoding="utf-8")).get("method", ""))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise StudyError(f"{scene}: {error}") from error
