#!/usr/bin/env python3
"""Lines of several `debias validate --unseen SEED --json -o FILE` as one: python3 src/validation/pool.py FILE...

One seed has 40 families, and some of its lines rest on one to five of them; the pool has them all. Counts are summed, medians
are those of all runs.
"""
import json
import statistics
import sys


def pooled(reports):
    """Name, measured, of, what is asked, for each line."""
    for k, gate in enumerate(reports[0]["gates"]):
        name = gate["name"]
        gates = [r["gates"][k] for r in reports]
        if name.startswith("median width"):
            is_open = name.endswith("open")
            widths = [
                run["width"]
                for r in reports
                for family in [{f["family"]: f for f in r["families"]}]
                for run in r["runs"]
                if run.get("width") and family[run["family"]]["within"] and (run["grade"] == "open") == is_open
            ]
            yield name, f"{statistics.median(widths):.2f}", len(widths), gate["demand"], gates
            continue
        total = sum(g["of"] for g in gates)
        is_share = gate["demand"].startswith("at least")
        hits = sum(g["measured"] * (g["of"] if is_share else 1) for g in gates)
        words = gate["demand"].split()  # "at most 14 of 143"
        most = f"at most {round(int(words[2]) / int(words[4]), 3)}" if gate["demand"].startswith("at most") else "about 0.95"
        yield name, f"{hits / total:.4f}", total, gate["demand"] if is_share else most, gates


def main():
    reports = []
    for path in sys.argv[1:]:
        with open(path, encoding="utf-8") as file:
            reports.append(json.load(file))
    if not reports:
        sys.exit("pool.py: no files (each written by `debias validate --unseen SEED --json -o FILE`)")
    runs = sum(len(r["runs"]) for r in reports)
    held = sum(all(g["holds"] for g in r["gates"]) for r in reports)
    print(f"{len(reports)} seeds, {runs} runs; {held} seeds hold every line\n")
    print(f"{'':50} {'share':>8} {'of':>7}   {'asked':16} seeds that fail")
    for name, measured, of, asked, gates in pooled(reports):
        failed = [str(r["seed"]) for r, g in zip(reports, gates) if not g["holds"]]
        print(f"{name:50} {measured:>8} {of:7}   {asked:16} {', '.join(failed)}".rstrip())


if __name__ == "__main__":
    main()
