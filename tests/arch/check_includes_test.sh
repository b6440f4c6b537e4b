#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The test of the test: each planted fault makes check_includes.sh fail and is named; the tree without it passes.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT

plant() { # plant FILE INCLUDED
  mkdir -p "$tree/$(dirname "$1")"
  printf '#pragma once\n  #  include "%s"\n' "$2" >"$tree/$1"
}

sound() { # a tree and a table without a fault
  rm -rf "${tree:?}"/*
  cat >"$tree/rooms.txt" <<'TABLE'
# A comment.
common/base        :
common/geometry    : common/base
worker/growing     : common/base
coordinator/store  : common/base
tools/synthetic    : common/base
pipeline/local     : worker/* coordinator/store
@tests             : tools/synthetic
TABLE
  plant common/base/check.h common/base/status.h
  plant common/geometry/camera.h common/base/check.h
  plant worker/growing/growing.h common/base/check.h
  plant worker/growing/growing_test.cc tools/synthetic/scene.h
  plant coordinator/store/job_store.h common/base/check.h
  plant tools/synthetic/scene.h common/base/check.h
  plant pipeline/local/a.h worker/growing/growing.h
  plant pipeline/local/b.h coordinator/store/job_store.h
}

expect() { # expect pass|fail WHAT [MESSAGE]
  if "$here/check_includes.sh" "$tree" "$tree/rooms.txt" >"$tree/log" 2>&1; then verdict=pass; else verdict=fail; fi
  if [[ $verdict != "$1" ]] || { [[ $# -gt 2 ]] && ! grep -qF -- "$3" "$tree/log"; }; then
    echo "$2: expected $1 ${3:-}, got $verdict:"
    cat "$tree/log"
    exit 1
  fi
  sound
}

sound
expect pass "a sound tree"
plant worker/growing/a.h coordinator/store/job_store.h
expect fail "a worker room that includes a coordinator room" \
  'worker/growing/a.h:2: worker/growing may not include coordinator/store'
plant coordinator/store/a.h worker/growing/growing.h
expect fail "a coordinator room that includes a worker room"
plant common/base/a.h common/geometry/camera.h
expect fail "an arrow backwards"
plant worker/growing/a.h b.h
expect fail "an include that is not rooted at the repository" '"b.h" is not rooted'
plant worker/growing/a_test.cc coordinator/store/job_store.h
expect fail "a worker's test that includes a coordinator room"
plant worker/growing/a.h tools/synthetic/scene.h
expect fail "production code that includes what only tests may"
plant common/util/a.h common/base/check.h
expect fail "a folder that is no room" 'its folder is no room'
echo 'common/base : common/geometry' >>"$tree/rooms.txt"
expect fail "two rows for one room" 'two rows for common/base'
sed -i 's|^common/geometry .*|& worker/growing|' "$tree/rooms.txt"
expect fail "an arrow that no file uses" 'no file needs common/geometry -> worker/growing'
sed -i 's|^@tests .*|& common/geometry|' "$tree/rooms.txt"
expect fail "an arrow of tests that no test uses" 'no file needs @tests -> common/geometry'
sed -i 's|^worker/growing .*|& tools/synthetic|' "$tree/rooms.txt"
expect fail "an arrow that only tests use, which all tests have" 'no file needs worker/growing -> tools/synthetic'
sed -i 's|^common/geometry .*|& worker/growing|; s|^worker/growing .*|& common/geometry|' "$tree/rooms.txt"
plant common/geometry/a.h worker/growing/growing.h
plant worker/growing/a.h common/geometry/camera.h
expect fail "a circle that the table allows" 'a circle: common/geometry -> worker/growing -> common/geometry'
yes '// A long file.' | head -n 100 >"$tree/common/base/long.cc" || true
expect fail "a folder above a third of the lines" 'common has 1'
echo "the check finds what was planted"
