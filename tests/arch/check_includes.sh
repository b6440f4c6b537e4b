#!/usr/bin/env bash
# Fails on any #include that breaks the table of rooms. Usage: check_includes.sh [ROOT]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=${1:-$(cd "$here/../.." && pwd)}

cd "$root"
folders=()
for folder in common worker coordinator pipeline tools clients cli tests; do
  if [[ -d $folder ]]; then folders+=("$folder"); fi
done
find "${folders[@]}" -type f \( -name '*.h' -o -name '*.cc' \) | LC_ALL=C sort |
  awk -v table="$here/rooms.txt" -f "$here/check_includes.awk"
