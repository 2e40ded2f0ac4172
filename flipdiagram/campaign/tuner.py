"""Gains that work most often: a search by optuna over the trials of a campaign, judged on trials it has not seen."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from flipdiagram.campaign.run import WORK
from flipdiagram.campaign.specification import Specification
from flipdiagram.campaign.statistics import paired, success_rate
from flipdiagram.campaign.tuning import Goal, TuneSection
from flipdiagram.errors import InputError
from flipdiagram.flips.driver import Flying
from flipdiagram.flips.flight import Work
from flipdiagram.flips.outcome import MODES, SUCCESS, Outcome
from flipdiagram.flips.run import Clock, Progress, fly_kept
from flipdiagram.flips.store_file import open_to_write
from flipdiagram.flips.workers import workers_of
from flipdiagram.scenario.scenario import value_of

BATCH = 4
"""Sets of gains tried at a time: the search is the same on any number of workers."""
STARTUP = 8
"""Sets drawn at random before the search learns."""

Gains = Mapping[str, Any]


@dataclass(frozen=True)
class Candidate:
    """A set of gains and what became of the trials under it."""

    gains: Gains
    outcomes: tuple[Outcome, ...]
    goal: Goal

    @property
    def won(self) -> list[bool]:
        """Whether the block was turned over, by trial."""
        return [outcome.mode == SUCCESS for outcome in self.outcomes]

    @property
    def score(self) -> float:
        """What is maximised."""
        return self.goal.score(self.won, self.errors)

    @property
    def errors(self) -> list[float | None]:
        """The metric whose quantile is given, by trial; None where there is none."""
        return [None if o.metrics is None else float(getattr(o.metrics, self.goal.metric)) for o in self.outcomes]

    def as_dict(self) -> dict[str, Any]:
        """Rate, interval, quantile, and how many flips ended how."""
        ended = Counter(outcome.mode for outcome in self.outcomes)
        modes = {mode: ended[mode] for mode in MODES if ended[mode]}
        rate = success_rate(sum(self.won), len(self.won))
        return {**rate, "quantile": self.goal.quantile_of(self.won, self.errors), "modes": modes}


def tune(
    specification: Specification,
    tuning: TuneSection,
    out: str | Path,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: Progress = lambda text: None,
    work: Work = WORK,
) -> dict[str, Any]:
    """Search within the budget, then compare the default with the best on held-out trials; plain data.

    Each flip is kept in `out`/tune.sqlite as it ends: an interrupted search goes on where it was.  Raises InputError
    where optuna is not installed or a file or cluster cannot be used.
    """
    search = _Search(tuning)
    held_out = held_out_trials(specification, tuning)
    count = max(tuning.budget // specification.trials, 2)
    clock = Clock(count * specification.trials + 2 * held_out.trials, progress)
    file = open_to_write(Path(out) / "tune.sqlite", {"digest": "flips of a tuner"})
    with file as store, workers_of(jobs, scheduler) as workers:
        flying = Flying(workers, store, work, specification.limits, clock.tick)
        default = {path: value_of(specification.base, path) for path in tuning.over}
        tried = _fly(specification, [default], tuning, flying, clock)
        search.tell_default(tried[0])
        while len(tried) < count:
            progress(f"{len(tried)} of {count} sets of gains, best: {_best(tried).as_dict()['rate']:.0%} turned over")
            asked = [search.ask() for _ in range(min(BATCH, count - len(tried)))]
            new = _fly(specification, [gains for _, gains in asked], tuning, flying, clock)
            for (question, _), candidate in zip(asked, new, strict=True):
                search.study.tell(question, candidate.score)
            tried += new
        best = _best(tried)
        progress(f"the default and the best on {held_out.trials} held-out trials")
        judged = _fly(held_out, [default, best.gains], tuning, flying, clock)
    return _summary(specification, tuning, tried, best, judged)


def held_out_trials(specification: Specification, tuning: TuneSection) -> Specification:
    """Trials of the same distributions that the search does not see."""
    sampler = "random" if specification.sampler in ("grid", "saltelli") else specification.sampler
    seed = (specification.seed + 0x5EED) % 2**32
    return replace(specification, seed=seed, trials=tuning.held_out, sampler=sampler)


def _best(tried: Sequence[Candidate]) -> Candidate:
    return max(tried, key=lambda candidate: candidate.score)  # the first of equals: the default stays where it can


class _Search:
    """optuna's TPE over the unit cube of the gains' distributions."""

    def __init__(self, tuning: TuneSection) -> None:
        try:
            import optuna
        except ImportError:
            raise InputError("tuning needs optuna; install it with: pip install 'flipdiagram[tune]'") from None
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._optuna, self._tuning = optuna, tuning
        sampler = optuna.samplers.TPESampler(seed=tuning.seed % 2**32, n_startup_trials=STARTUP)
        self.study = optuna.create_study(direction="maximize", sampler=sampler)
        self._space: dict[str, Any] = {path: optuna.distributions.FloatDistribution(0.0, 1.0) for path in tuning.over}

    def tell_default(self, candidate: Candidate) -> None:
        """Where the default stands and how well it does, if it can be drawn at all."""
        at = {path: d.position(candidate.gains[path]) for path, d in self._tuning.over.items()}
        if None not in at.values():
            trial = self._optuna.trial.create_trial(params=at, distributions=self._space, value=candidate.score)
            self.study.add_trial(trial)

    def ask(self) -> tuple[Any, Gains]:
        """A question, for `study.tell`, and the gains to be tried."""
        question = self.study.ask(self._space)
        return question, {path: d.value(question.params[path]) for path, d in self._tuning.over.items()}


def _fly(
    specification: Specification, candidates: Sequence[Gains], tuning: TuneSection, flying: Flying, clock: Clock
) -> list[Candidate]:
    """Fly sets of gains over trials, apart from what the store holds: the candidates with their outcomes."""
    flights = []
    for gains in candidates:
        tuned = replace(specification, base=specification.base.with_overrides(gains))
        flights += [tuned.flight(tuned.trial(k), tuning.architecture) for k in range(specification.trials)]
    outcomes = fly_kept(flights, flying, lambda missing: clock.leave_out(len(flights) - missing))
    each = [tuple(outcomes[k : k + specification.trials]) for k in range(0, len(outcomes), specification.trials)]
    return [Candidate(gains, of, tuning.goal) for gains, of in zip(candidates, each, strict=True)]


def _summary(
    specification: Specification, tuning: TuneSection, tried: list[Candidate], best: Candidate, judged: list[Candidate]
) -> dict[str, Any]:
    default, tuned = judged
    compared = paired(tuned.won, default.won)
    return {
        "architecture": tuning.architecture,
        "objective": tuning.goal.text,
        "quantile_name": tuning.goal.quantile_name,
        "candidates": len(tried),
        "flips": len(tried) * specification.trials,
        "best": tried.index(best),
        "gains": {path: {"default": tried[0].gains[path], "tuned": best.gains[path]} for path in tuning.over},
        "search": {"trials": specification.trials, "default": tried[0].as_dict(), "tuned": best.as_dict()},
        "held_out": {
            "trials": len(default.won),
            "default": default.as_dict(),
            "tuned": tuned.as_dict(),
            "difference": {name: compared[name] for name in ("difference", "low", "high", "p")},
        },
        "history": [c.as_dict() | {"gains": dict(c.gains), "score": c.score} for c in tried],
    }
