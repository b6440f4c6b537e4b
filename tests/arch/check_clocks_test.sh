#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The test of the test: each planted reading of a clock makes check_clocks.sh fail and is named.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
mkdir -p "$tree/common/base" "$tree/worker/agent"
echo 'absl::Time Now() { return absl::Now(); }' >"$tree/common/base/clock.cc"
echo 'common/base/clock.cc : is the clock' >"$tree/clocks.txt"

expect() { # expect pass|fail WHAT [MESSAGE]
  if "$here/check_clocks.sh" "$tree" "$tree/clocks.txt" >"$tree/log" 2>&1; then verdict=pass; else verdict=fail; fi
  if [[ $verdict != "$1" ]] || ! grep -qF -- "${3:-}" "$tree/log"; then
    echo "$2: expected $1 ${3:-}, got $verdict:"
    cat "$tree/log"
    exit 1
  fi
}

expect pass "a sound tree"
while read -r code; do
  printf 'int a;\n%s\n' "$code" >"$tree/worker/agent/agent.cc"
  expect fail "$code" 'worker/agent/agent.cc:2: reads a clock'
done <<'CODE'
const auto begin = std::chrono::steady_clock::now();
const auto begin = SteadyClock::now();
const absl::Time now = absl::Now();
const auto now = std::time(nullptr);
clock_gettime(CLOCK_MONOTONIC, &now);
CODE
echo 'const Stopwatch time(clock); last_write_time(path); clock.Now();' >"$tree/worker/agent/agent.cc"
expect pass "a file that only sounds like it"
echo 'worker/agent/agent.cc : why not' >>"$tree/clocks.txt"
expect fail "a row that no file needs" 'worker/agent/agent.cc reads no clock'
echo "the check finds what was planted"
