#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fails when a file or program names another version, or another day of release, than the project's: project() in the top
# CMakeLists.txt and that version's line in CHANGELOG.md.
# Usage: check_version.sh VERSION [PROGRAM...]
set -euo pipefail
version=$1
shift
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
wrong=0

expect() { # expect WHERE EXPECTED FOUND
  if [[ $2 != "$3" ]]; then
    echo "$1: expected $2, found ${3:-nothing}" >&2
    wrong=1
  fi
}

if [[ $(grep -m 1 '^## ' CHANGELOG.md) != '## Unreleased' ]]; then
  echo 'CHANGELOG.md: expected "## Unreleased" before all releases' >&2
  wrong=1
fi
# "## 1.2.3 (2026-01-31)", the newest first.
release=$(grep -m 1 -E '^## [0-9]' CHANGELOG.md)
day=$(sed -nE 's/^## [0-9.]+ \(([0-9]{4}-[0-9]{2}-[0-9]{2})\)$/\1/p' <<<"$release")
expect "CHANGELOG.md's newest release" "## $version ($day)" "$release"
expect CITATION.cff "version: $version" "$(grep '^version:' CITATION.cff)"
expect CITATION.cff "date-released: $day" "$(grep '^date-released:' CITATION.cff)"
while IFS=: read -r file line; do
  expect "$file" "newTag: $version" "$line"
done < <(grep -ro --include=kustomization.yaml 'newTag:.*' deploy)
expect clients/python/pyproject.toml "version = \"$version\"" "$(grep '^version' clients/python/pyproject.toml)"
for program in "$@"; do
  expect "$program --version" "$(basename "$program") $version" "$("$program" --version)"
done
exit "$wrong"
