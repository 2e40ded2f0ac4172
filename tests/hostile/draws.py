"""Cases drawn at random: a kind is a function of a `random.Random` that gives a command line and its files."""

import math

import yaml
from hostile.models import FAULTS, MODELS, TEXTS, spoiled
from hostile.table import Case, run

from flipdiagram.campaign.distributions import KINDS as DISTRIBUTIONS
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.scenario.text import fields_of, spans_of

FIELDS = fields_of(Scenario)
SENSELESS = (math.nan, math.inf, -math.inf, 1e300, -1e300, 1e-300, 5e-324, -0.0, 10**30, "text", "", None, True, [], {})
FILES = [path for path in FIELDS if path.endswith(".file")]


def value(dice, path):
    """A value of a field: a border, something between, something near, or nonsense."""
    spans = spans_of(FIELDS[path])
    if not spans or dice.random() < 0.1:
        return dice.choice(SENSELESS)
    drawn = [number(dice, *span) for span in spans]
    whole = "int" in repr(FIELDS[path].annotation)
    drawn = [round(one) if whole else one for one in drawn]
    if "tuple" not in repr(FIELDS[path].annotation):
        return drawn[0]
    return drawn if len(drawn) > 1 else drawn * dice.choice((1, 6, 6, 7))


def number(dice, low, high):
    """Mostly inside a range, on a logarithmic scale where it spans decades."""
    kind = dice.random()
    if kind < 0.25:
        return dice.choice((low, high))
    if kind < 0.35:
        return dice.choice((low - abs(low) * 1e-9 - 1e-12, high * 1.0001 + 1e-12))
    if low > 0 and high / low > 100:
        return low * (high / low) ** dice.random()
    return dice.uniform(low, high)


def fields(dice, most=3):
    """Some fields with values, as they stand in a file."""
    paths = dice.sample([path for path in FIELDS if path not in FILES], dice.randint(1, most))
    sections = {}
    for path in paths:
        section, name = path.split(".")
        sections.setdefault(section, {})[name] = value(dice, path)
    return sections


def scenario(dice, command=("plan", "--quiet")):
    """A partial scenario that is planned, or refused."""
    return Case("scenario", [*command, "--scenario", "a.yaml"], 0, (), {"a.yaml": dump(fields(dice))})


def flip(dice):
    """A partial scenario that is flown, shortly."""
    return scenario(dice, ("flip", "--quiet", "--quick", "--no-replay", "--architecture", "pd+ff+dob", "--jobs", "1"))


def specification(dice):
    """A campaign that is checked to its end, and then refused: no flip can be as quick as it asks."""
    vary = {}
    for path in dice.sample(list(FIELDS), dice.randint(1, 3)):
        kind = dice.choice(list(DISTRIBUTIONS))
        vary[path] = {kind: [value(dice, path) for _ in range(dice.choice((1, 2, 2, 2, 3)))]}
    text = {"vary": vary, "trials": dice.choice((1, 4, 10**6, value(dice, "sensors.noise_seed"))), "limit_hours": 1e-6}
    for key in ("seed", "timeout", "memory", "sampler", "known", "architectures", "tune", "base"):
        if dice.random() < 0.1:
            text[key] = dice.choice((*SENSELESS, fields(dice)))
    return Case("specification", ["campaign", "--quiet", "c.yaml"], 0, (), {"c.yaml": dump(text)})


def model(dice):
    """A model file with faults, by which a motion is planned."""
    name, text, field, overrides = MODELS[dice.choice(list(MODELS))]
    faults = [
        (dice.choice(FAULTS), dice.randrange(10**6), dice.randrange(10**6), dice.choice(TEXTS))
        for _ in range(dice.randint(1, 3))
    ]
    sections = {}
    for path, given in {**overrides, field: name}.items():
        section, key = path.split(".")
        sections.setdefault(section, {})[key] = given
    files = {"a.yaml": dump(sections), name: spoiled(text, faults)}
    return Case("model", ["plan", "--quiet", "--scenario", "a.yaml"], 0, (), files)


def words(dice):
    """Words of the command line that nobody would write."""
    some = ["plan", "info", "scenario", "--out", "--jobs", "--yes", "--quiet", "--", "-h", "", "x", "9" * 30, "--a.b=1"]
    return Case("words", ["scenario", *dice.choices(some, k=dice.randint(0, 4))], 0)


def dump(data):
    """YAML, its numbers in the spelling of YAML 1.2."""
    return yaml.safe_dump(data, sort_keys=False, default_flow_style=None)


KINDS = {
    "scenario": (scenario, 10),
    "specification": (specification, 4),
    "model": (model, 4),
    "words": (words, 1),
    "flip": (flip, 1),
}
"""Name → (what draws it, how often)."""


def drawn(dice, kinds=KINDS):
    """A case of one of the kinds."""
    (name,) = dice.choices(list(kinds), [kinds[name][1] for name in kinds])
    return kinds[name][0](dice)


def ending(case, capture):
    """(exit code, what is wrong with it or None) of a case in this process; capture() gives stderr since the last."""
    capture()
    try:
        code = run(case.words)
    except BaseException as error:
        return None, f"{type(error).__name__}: {error}"
    said = capture()
    if code not in (0, 2, 3) or "Traceback" in said:
        return code, f"exit code {code}: {said}"
    return code, None if said.count("\n") == (code != 0) else f"exit code {code}, not one line: {said}"
