"""Makes tests/reports/truth/store anew:  python -m tests.kit.truth_store

Runs tests/reports/truth/sweep.toml and drops the float64 states, which no report reads. Two facts are then
set so that a mix-up shows. Wall seconds are several times the CPU's. Of the replicates of `area` at the
narrowest gap the first is called ok, its fellows are not.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from pipeline.store.sealed_folder import SEAL, sealed
from scenes.hashing import hash_file

TRUTH = Path(__file__).parents[1] / "reports" / "truth"


def main() -> None:
    """Replace the store."""
    store = TRUTH / "store"
    shutil.rmtree(store, ignore_errors=True)
    command = ["-m", "penumbra", "run", str(TRUTH / "sweep.toml"), "--out", str(store), "--workers", "1"]
    subprocess.run([sys.executable, *command], check=True)
    for path in store.rglob("*.npz"):
        path.unlink()
    for path in store.glob("cells/*/record.json"):
        record = json.loads(path.read_text(encoding="utf-8"))
        _set_apart(record)
        path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    for entry in [seal.parent for seal in store.rglob(SEAL)]:
        names = [name for name in sealed(entry) if (entry / name).is_file()]
        (entry / SEAL).write_text("".join(f"{hash_file(entry / name)}  {name}\n" for name in names))


def _set_apart(record: dict[str, Any]) -> None:
    job, statistics = record["job"], record["statistics"]
    record["seconds"]["render"] = record["seconds"]["cpu"] * (5.0 + 0.25 * job["seed"])
    record["provenance"] |= {"machine": "a machine", "commit": "0123abcd"}
    if job["parameters"].get("gap", 1.0) < 1.0 and job["estimator"] == "area":
        good = job["seed"] == 0
        statistics |= {"hill": 5.0 if good else 1.25, "max_share": 0.001 if good else 0.3}
        statistics |= {"verdict": "ok" if good else "untrustworthy", "reason": f"set by hand, {good}"}


if __name__ == "__main__":
    main()
