#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The test of the test: check-spdx names a file that lacks its licence, --add mends it, and what is right stays as it is.
# Usage: check_spdx_test.sh CHECK_SPDX
set -euo pipefail
check=$1
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
cd "$tree"

fail() {
  echo "$1" >&2
  exit 1
}

mkdir -p room build
printf 'int a;\n' >room/a.cc
printf '// SPDX-License-Identifier: Apache-2.0\nint b;\nint b2;\nint b3;\nint b4;\n' >room/b.h
printf '#!/bin/sh\nexit 0\n' >room/program
printf '#!/bin/sh\n# SPDX-License-Identifier: Apache-2.0\nexit 0\n' >room/sound
printf '1\n2\n3\n-- SPDX-License-Identifier: Apache-2.0\n5\n' >room/late.sql
printf 'int c;\nint c2;\nint c3;\n// SPDX-License-Identifier: Apache-2.0\n' >room/last.h
printf 'made\n' >build/made.cc
printf 'words\n' >notes.md
chmod +x room/program
if "$check" "$tree" >log 2>&1; then fail "four files without a licence passed"; fi
diff - log <<'END' || fail "other files are named"
./room/a.cc: expected "// SPDX-License-Identifier: Apache-2.0" in the first three lines
./room/last.h: expected "// SPDX-License-Identifier: Apache-2.0" in the first three lines
./room/late.sql: expected "-- SPDX-License-Identifier: Apache-2.0" in the first three lines
./room/program: expected "# SPDX-License-Identifier: Apache-2.0" in the first three lines
4 files do not say their licence (scripts/check-spdx --add)
END
cp room/b.h room/b.before
"$check" --add "$tree" >/dev/null
"$check" "$tree" || fail "--add left a file without its line"
cmp room/b.h room/b.before || fail "a file that was right was changed"
[[ $(<room/a.cc) == $'// SPDX-License-Identifier: Apache-2.0\nint a;' ]] || fail "the line does not stand first"
[[ -x room/program && $(head -n 1 room/program) == '#!/bin/sh' ]] || fail "a script does not start any more"
echo "check-spdx finds and mends what was planted"
