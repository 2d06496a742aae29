#!/usr/bin/env python3
"""Runs the benches and writes what they say as one Markdown table and one JSON.

    python3 bench/report.py BUILD/debias_bench [--filter REGEX] [--output out/bench]

writes OUTPUT.md and OUTPUT.json (default: out/bench): everything but the tables that the benches print themselves
(--benchmark_filter=table). Without a filter it takes some twenty minutes on an idle machine, the slopes most of it.
"""
import argparse
import datetime
import json
import os
import pathlib
import platform
import subprocess
import sys
import tempfile

# What Google Benchmark writes beside the counters of ours.
OWN = {"name", "family_index", "per_family_instance_index", "run_name", "run_type", "repetitions", "repetition_index",
       "threads", "iterations", "real_time", "cpu_time", "time_unit", "label", "error_occurred", "error_message"}


def processor():
    for line in open("/proc/cpuinfo", encoding="ascii", errors="replace"):
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown"


def number(x):
    return f"{x:.4g}" if isinstance(x, float) else str(x)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("bench", help="the program debias_bench")
    arguments.add_argument("--filter", default="-^table", help="which benches: --benchmark_filter")
    arguments.add_argument("--output", default="out/bench", help="path of both files, without .md and .json")
    options = arguments.parse_args()

    with tempfile.TemporaryDirectory() as folder:
        raw = os.path.join(folder, "bench.json")
        command = [options.bench, f"--benchmark_filter={options.filter}", f"--benchmark_out={raw}",
                   "--benchmark_out_format=json"]
        result = subprocess.run(command, stdout=sys.stderr, check=False)
        if result.returncode != 0:
            sys.exit(f"report: {options.bench} ended with {result.returncode}")
        with open(raw, encoding="utf-8") as file:
            measured = json.load(file)
    if not measured["benchmarks"]:
        sys.exit(f"report: no bench matches {options.filter!r}; `{options.bench} --benchmark_list_tests` names them")

    rows = []
    for bench in measured["benchmarks"]:
        row = {"name": bench["name"].replace("/iterations:1", ""),
               "counters": {k: v for k, v in bench.items() if k not in OWN}}
        if bench.get("label"):
            row["note"] = bench["label"]
        if bench.get("error_occurred"):
            row["error"] = bench["error_message"]
        rows.append(row)
    report = {"date": datetime.date.today().isoformat(), "processor": processor(), "cores": os.cpu_count(),
              "load": measured["context"].get("load_avg"), "benches": rows}

    output = pathlib.Path(options.output)
    output.parent.mkdir(parents=True, exist_ok=True)
    output.with_suffix(".json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    lines = [f"{report['date']}, {report['processor']}, {report['cores']} cores, load {report['load']}", "",
             "| bench | figures | |", "|---|---|---|"]
    for row in rows:
        figures = ", ".join(f"{k} {number(v)}" for k, v in row["counters"].items())
        lines.append(f"| {row['name']} | {figures} | {row.get('error') or row.get('note', '')} |")
    output.with_suffix(".md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{len(rows)} benches: {output}.md, {output}.json")


if __name__ == "__main__":
    main()
