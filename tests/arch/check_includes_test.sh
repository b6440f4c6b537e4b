#!/usr/bin/env bash
# The test of the test: a planted include makes check_includes.sh fail, an allowed one does not.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
mkdir -p "$tree/worker/growing" "$tree/coordinator/store" "$tree/common/base" "$tree/pipeline/local"

expect() {  # expect pass|fail WHAT
  if "$here/check_includes.sh" "$tree" >"$tree/log" 2>&1; then verdict=pass; else verdict=fail; fi
  if [[ $verdict != "$1" ]]; then
    echo "$2: expected $1, got $verdict"
    cat "$tree/log"
    exit 1
  fi
}

plant() { printf '#pragma once\n  #  include "%s"\n' "$2" >"$tree/$1"; }

plant worker/growing/a.h common/base/check.h
expect pass "an arrow of the table"
plant worker/growing/a.h worker/growing/b.h
expect pass "a room's own file"
plant worker/growing/a.h coordinator/store/job_store.h
expect fail "a worker room that includes a coordinator room"
grep -q 'worker/growing/a.h:2: worker/growing may not include coordinator/store' "$tree/log"
plant worker/growing/a.h common/base/check.h
plant coordinator/store/a.h worker/growing/a.h
expect fail "a coordinator room that includes a worker room"
rm "$tree/coordinator/store/a.h"
plant common/base/a.h common/geometry/camera.h
expect fail "an arrow backwards"
rm "$tree/common/base/a.h"
plant worker/growing/a.h b.h
expect fail "an include that is not rooted at the repository"
plant worker/growing/a.h common/base/check.h
plant worker/growing/a_test.cc tools/synthetic/scene.h
expect pass "a test that uses the synthetic world"
plant worker/growing/a_test.cc coordinator/store/job_store.h
expect fail "a worker's test that includes a coordinator room"
rm "$tree/worker/growing/a_test.cc"
plant pipeline/local/a.h worker/growing/a.h
expect pass "pipeline/local, which links both"
mkdir "$tree/common/util"
plant common/util/a.h common/base/check.h
expect fail "a folder that is no room"
echo "the check finds what was planted"
