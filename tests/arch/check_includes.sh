#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fails on any #include that breaks the table of rooms, on circles of rooms, on rows and arrows of the table that are
# double or not needed, and on a top-level folder above a third of the lines. --list prints the graph of the rooms (lines,
# room, what it includes, and each top-level folder's share) and its circles instead.
# Usage: check_includes.sh [--list] [ROOT [TABLE]]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
list=0
if [[ ${1:-} == --list ]]; then
  list=1
  shift
fi
root=${1:-$(cd "$here/../.." && pwd)}
table=${2:-$root/tests/arch/rooms.txt}

cd "$root"
folders=()
for folder in common program worker coordinator pipeline tools clients cli tests; do
  if [[ -d $folder ]]; then folders+=("$folder"); fi
done
# Programs of others, which are built against what is installed, are no part of the house.
find "${folders[@]}" -type f \( -name '*.h' -o -name '*.cc' \) -not -path 'tests/install/consumer/*' | LC_ALL=C sort |
  awk -v table="$table" -v list_graph="$list" -v max_share="${MAX_SHARE:-0.3334}" -f "$here/check_includes.awk"
