#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fails where JSON is made text by `dump`, which throws at bytes that are not UTF-8; common/json/json_text.h does not.
# Usage: check_json_text.sh [ROOT]
set -euo pipefail
cd "${1:-$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)}"
found=$(grep -rn --include='*.cc' --include='*.h' '[.>]dump(' common program worker coordinator pipeline tools clients cli |
  grep -v '_test\.cc:\|_testing\.h:\|^common/json/json_text\.h:\|error_handler_t::replace' || true)
[[ -z $found ]] || { echo "JsonText expected in the place of dump:" && echo "$found" && exit 1; }
