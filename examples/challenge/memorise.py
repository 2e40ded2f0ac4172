"""Write the table of `memoriser.py`: for each public start an entry that turned the block over in MuJoCo.

    python examples/challenge/memorise.py

It reads the results of the entries that are plain functions; all of them have flown in MuJoCo.
"""

import json
from collections import Counter, defaultdict
from pathlib import Path

from flipdiagram.studies.challenge.score import load_results
from flipdiagram.studies.challenge.suites import PUBLIC, load_suites

FOLDER = Path(__file__).parent


def main() -> None:
    """See who turned the block over where; of several the first by name is taken."""
    won: dict[tuple[str, int], Counter[str]] = defaultdict(Counter)
    for result in load_results(FOLDER / "results"):
        name = Path(result["entry"]["file"]).stem
        if result["entry"]["kinds"] == ["control"] and name != "memoriser":
            for flip in result["flips"]:
                if flip["kind"] == PUBLIC and flip["engine"] == "mujoco":
                    won[flip["suite"], flip["index"]][name] += flip["outcome"] == "turned over"
    suites = load_suites()
    table = {}
    for world in suites.worlds(suites.names):
        if counts := won.get((world.suite, world.index)):
            start = world.trial.overrides["task.start_y"]
            table[str(start)] = min(counts, key=lambda name, counts=counts: (-counts[name], name))
    (FOLDER / "memoriser.json").write_text(json.dumps(table, indent=0) + "\n", encoding="utf-8")
    print(f"{len(table)} starts: {dict(Counter(table.values()).most_common())}")


if __name__ == "__main__":
    main()
