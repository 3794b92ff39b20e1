"""Our search beside those of others, on readings that are recorded first: ``make bench-peers``.

A simulated robot is identified; what it read in all its movements is then given at once to each of
the others, with the same forward model and the same likelihood, one process and one thread.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # before libraries are loaded

import argparse
import csv
import sys
from dataclasses import asdict
from pathlib import Path

from bench.peers.comparison import Row, rows_of, table
from bench.peers.peers import PEERS
from bench.power.trial import Trial, as_stated


def main() -> None:
    """Prints the table, and writes ``peers.csv`` and ``peers.md``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problem", default="topological")
    parser.add_argument(
        "--exact", action="store_true", help="ours takes the robot to be just as stated, too"
    )
    parser.add_argument("--interactions", type=int, default=6)
    parser.add_argument("--explore", help="rule that chooses movements; default: the method's")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--peers", nargs="*", choices=PEERS, default=list(PEERS))
    parser.add_argument("--seconds", type=float, default=60.0, help="CPU of each peer, at most")
    parser.add_argument("--out", type=Path, default=Path("runs/peers"))
    options = parser.parse_args()
    trial = Trial(
        name=f"{options.problem}{' as stated' * options.exact} {options.interactions} "
        f"{options.explore or 'chosen'}",
        seeds=tuple(options.seeds),
        problem=as_stated(options.problem) if options.exact else options.problem,
        interactions=options.interactions,
        explore=options.explore,
    )
    rows: list[Row] = []
    peers = {name: PEERS[name] for name in options.peers}
    for seed in options.seeds:
        rows += rows_of(trial, seed, options.out, peers, options.seconds)
        print(f"seed {seed} is done", file=sys.stderr)
    with (options.out / "peers.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, asdict(rows[0]))
        writer.writeheader()
        writer.writerows(map(asdict, rows))
    text = table(rows)
    (options.out / "peers.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
