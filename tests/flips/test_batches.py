"""Batches: how many calls they carry, and that what one call does is no other's business."""

import json
import os
from concurrent.futures import Future

import pytest
from campaign.made_up import QUIET, WORK, contents
from flips.tasks import do
from patience import loaded

from flipdiagram.campaign.checks import from_text
from flipdiagram.campaign.draw import missing_draws
from flipdiagram.campaign.run import run
from flipdiagram.flips import child_process
from flipdiagram.flips.batches import MOST, Answer, Batch, Pace, batch_size
from flipdiagram.flips.child_process import Limits, TrialError, TrialLimitError, WorkerLostError
from flipdiagram.flips.driver import ATTEMPTS, Flying, fly_all
from flipdiagram.flips.store_file import open_to_read, open_to_write
from flipdiagram.flips.workers import BATCH_SECONDS, BATCHES_A_SECOND, Workers, batch_seconds


@pytest.mark.parametrize(
    ("seconds", "each", "last", "left", "width", "size"),
    [
        (5.0, 0.5, 100, 10**6, 2, 10),  # as many as fit
        (5.0, 20.0, 100, 10**6, 2, 1),  # a long one still needs a batch
        (0.0, 1e-3, 100, 10**6, 2, 1),  # processes of this machine
        (5.0, 1e-3, 4, 10**6, 2, 8),  # no faster than twice the last
        (5.0, 1e-6, 4096, 10**6, 2, MOST),
        (5.0, 0.0, 4096, 10**6, 2, MOST),
        (5.0, 1e-3, 256, 60, 4, 5),  # of what is left everyone gets something, three times
        (5.0, 1e-3, 256, 1, 4, 1),
        (5.0, 1e-3, 256, 0, 4, 1),
        (33.0, 1.5, 256, 10**6, 1000, 22),  # a million on a thousand cores
    ],
)
def test_a_batch_has_as_many_calls_as_fit_into_its_time_grows_slowly_and_shrinks_at_the_end(
    seconds, each, last, left, width, size
):
    assert batch_size(seconds, each, last, left, width) == size


def test_a_cluster_of_any_size_ends_a_bounded_number_of_batches_a_second():
    least, most = BATCH_SECONDS
    assert batch_seconds(1) == least and batch_seconds(10**6) == most
    for width in (300, 1000, 1800):
        assert width / batch_seconds(width) == pytest.approx(BATCHES_A_SECOND)


def test_sizes_follow_the_calls_that_have_ended():
    pace, sizes = Pace(), []
    for _ in range(8):
        sizes.append(pace.size(10.0, 10**6, 2))
        pace.add([Answer(None, None, 0.5)] * sizes[-1])
    assert sizes == [1, 2, 4, 8, 16, 20, 20, 20]
    for _ in range(10):  # they become slower
        pace.add([Answer(None, None, 2.0)] * 5)
    assert pace.size(10.0, 10**6, 2) == 5


def test_each_call_of_a_batch_has_its_own_outcome_and_a_lost_child_ends_the_batch():
    tasks = [(what,) for what in ("well", "hang", "well", "raise", "well", "die", "well")]
    with Workers(1) as workers:
        answers = workers.submit_batch(Batch(do, tasks, Limits(loaded(1.0), 4.0))).result()
    errors = [type(answer.error) for answer in answers]
    none = type(None)
    assert errors == [none, TrialLimitError, none, TrialError, none, WorkerLostError]  # the last was not begun
    assert answers[1].error.kind == "timeout" and answers[1].seconds >= 1.0
    first, second, third = (answers[k].value for k in (0, 2, 4))
    assert first != second == third and os.getpid() not in (first, second)
    assert child_process.children() == []


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return contents(run(from_text(QUIET), tmp_path_factory.mktemp("single"), jobs=1, work=WORK).file)


def test_rows_do_not_depend_on_the_size_of_the_batches(tmp_path, monkeypatch, undisturbed):
    sizes = []
    submit = Workers.submit_batch
    monkeypatch.setattr(Workers, "batch_seconds", lambda self, width: 60.0)
    monkeypatch.setattr(Workers, "submit_batch", lambda self, b: sizes.append(len(b.tasks)) or submit(self, b))
    assert contents(run(from_text(QUIET), tmp_path, jobs=2, work=WORK).file) == undisturbed
    assert max(sizes) > 4 and sizes[-1] < max(sizes) and sum(sizes) == 61  # and the plan


class Losing(Workers):
    """A cluster that loses each batch in which a certain trial is, and does not say at which it was."""

    def __init__(self, fatal):
        super().__init__(2)
        self.fatal, self.lost = fatal, []

    def batch_seconds(self, width):
        return 60.0

    def submit_batch(self, batch):
        future = Future()
        orders = [order for _, order, *_ in batch.tasks]
        if batch.function.__name__ == "fly_order" and any(order.trial == self.fatal for order in orders):
            self.lost.append(len(orders))
            future.set_exception(OSError("the worker was killed"))
        else:
            future.set_result([Answer(batch.function(*task), None, 0.01) for task in batch.tasks])
        return future


def test_a_lost_batch_loses_no_trial_and_blames_none_but_the_one_that_is_always_lost(tmp_path, undisturbed):
    specification = from_text(QUIET.replace("pd, pd+ff+dob", "pd"))
    path = tmp_path / "campaign.sqlite"
    meta = {"digest": specification.digest, "specification": json.dumps(specification.as_dict())}
    with Losing(fatal=17) as workers, open_to_write(path, meta) as store:
        flying = Flying(workers, store, WORK, specification.limits)
        fly_all(missing_draws(specification, {}), specification.rows, flying)
    with open_to_read(path) as store:
        rows = list(store.rows())
    assert [row.trial for row in rows] == list(range(30))
    assert {row.trial: row.attempts for row in rows} == {k: 1 for k in range(30)} | {17: ATTEMPTS}
    assert rows[17].failure == f"crashed: lost its worker {ATTEMPTS} times: the worker was killed"
    others = [row for row in contents(path) if row["trial"] != 17]
    assert others == [row for row in undisturbed if row["architecture"] == "pd" and row["trial"] != 17]
    assert workers.lost[0] > 1 and workers.lost[1:] == [1] * ATTEMPTS
