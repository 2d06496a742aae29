#!/usr/bin/env python3
"""Lines of several `debias validate --unseen SEED --json -o FILE` as one: python3 src/validation/pool.py FILE...

One seed has 40 families, and some of its lines rest on one to five of them; the pool has them all. Counts are summed, medians
are those of all runs. Fails where a line of the pool does.
"""
import json
import statistics
import sys

level = 0.95
in_band = statistics.NormalDist().inv_cdf(1 - 5e-7)


def pooled(reports):
    """Name, measured, of, what is asked, whether it holds, the lines of each seed."""
    for k, gate in enumerate(reports[0]["gates"]):
        name = gate["name"]
        demand = gate["demand"]
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
            median = statistics.median(widths or [0])
            yield name, f"{median:.2f}", len(widths), demand, median <= float(demand.split()[2]), gates
            continue
        total = sum(g["of"] for g in gates)
        if total == 0:  # nothing to judge
            yield name, "", 0, demand, True, gates
            continue
        if demand.startswith("at least"):
            share = sum(g["measured"] * g["of"] for g in gates) / total
            holds = share >= float(demand.split()[2])
        else:
            share = sum(g["measured"] for g in gates) / total
            if demand.startswith("at most"):  # "at most 14 of 143"
                words = demand.split()
                most = int(words[2]) / int(words[4])
                holds = share <= most
                demand = f"at most {most:.3f}"
            else:  # coverage, in the band that nearly all runs of such intervals give
                holds = abs(share - level) <= in_band * (level * (1 - level) / total) ** 0.5
                demand = f"about {level}"
        yield name, f"{share:.4f}", total, demand, holds, gates


def main():
    reports = []
    for path in sys.argv[1:]:
        with open(path, encoding="utf-8") as file:
            reports.append(json.load(file))
    if not reports:
        sys.exit("pool.py: no files (each written by `debias validate --unseen SEED --json -o FILE`)")
    runs = sum(len(r["runs"]) for r in reports)
    print(f"{'':50} {'share':>8} {'of':>7}   {'asked':16}       seeds that fail")
    lines = list(pooled(reports))
    for name, measured, of, asked, holds, gates in lines:
        failed = [str(r["seed"]) for r, g in zip(reports, gates) if not g["holds"]]
        outcome = "holds" if holds else "FAILS"
        print(f"{name:50} {measured:>8} {of:7}   {asked:16} {outcome} {', '.join(failed)}".rstrip())
    alone = sum(all(g["holds"] for g in r["gates"]) for r in reports)
    held = sum(line[4] for line in lines)
    print(f"\nseeds {reports[0]['seed']} to {reports[-1]['seed']}, {runs} runs: {held} lines hold, {len(lines) - held} fail;"
          f" {alone} of {len(reports)} seeds hold all of them alone")
    sys.exit(held < len(lines))


if __name__ == "__main__":
    main()
