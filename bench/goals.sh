#!/bin/sh
# sh bench/goals.sh BENCH FOLDER: each row of goals_bench into a file of its own; a row that is there is not run again.
# BENCH is build/release/debias_bench. The picture: python3 notebooks/pictures/draw.py FOLDER/*.json
set -eu
bench=$1
folder=$2
mkdir -p "$folder"
for row in $("$bench" --benchmark_list_tests --benchmark_filter='^goals/' | sed 's#/iterations:1$##'); do
  file=$folder/$(echo "$row" | tr / _).json
  [ -s "$file" ] && continue
  "$bench" --benchmark_filter="^$row/" --benchmark_out="$file.part" --benchmark_out_format=json > /dev/null
  mv "$file.part" "$file"
done
