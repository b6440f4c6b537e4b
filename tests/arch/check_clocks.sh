#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fails when C++ reads a clock by itself instead of through common/base/clock.h, where a test can set it. TABLE lists the
# files that may, each with its reason; one that does not need it any more fails too.
# Usage: check_clocks.sh [ROOT [TABLE]]
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "${1:-$here/../..}" && pwd)
table=${2:-$root/tests/arch/clocks.txt}
cd "$root"

readers='(_clock|Clock)::now\(|\babsl::(Now|GetCurrentTimeNanos)\(|\b(std::|::)?time\((nullptr|NULL|0|&)|\bgettimeofday\(|\bclock_gettime\('
folders=()
for folder in common program worker coordinator pipeline tools clients cli tests; do
  if [[ -d $folder ]]; then folders+=("$folder"); fi
done
found=$(grep -rlE --include='*.cc' --include='*.h' "$readers" "${folders[@]}" | LC_ALL=C sort || true)
allowed=$(sed -e 's/#.*//' -e 's/[[:space:]]*:.*//' -e '/^[[:space:]]*$/d' "$table" | LC_ALL=C sort)

broken=0
while read -r file; do
  [[ -n $file ]] || continue
  grep -nE "$readers" "$file" | sed "s|^\([0-9]*\):.*|$file:\1: reads a clock; use common/base/clock.h|"
  broken=$((broken + 1))
done < <(LC_ALL=C comm -23 <(echo "$found") <(echo "$allowed"))
while read -r file; do
  [[ -n $file ]] || continue
  echo "$table: $file reads no clock"
  broken=$((broken + 1))
done < <(LC_ALL=C comm -13 <(echo "$found") <(echo "$allowed"))
if ((broken > 0)); then exit 1; fi
echo "$(wc -l <<<"$allowed") files read a clock themselves, with a reason"
