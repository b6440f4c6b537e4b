# SPDX-License-Identifier: Apache-2.0
# Reads ctest's JUnit file; for each test that is a GoogleTest program the cases in results/NAME.xml count, otherwise the
# test itself. A program that failed without a failed case (crash, time limit) counts as one failure more, and so does a
# test that could not be run for any other reason than its own wish to be skipped.

function attribute(line, name,    at, text) {
  at = index(line, " " name "=\"")
  if (at == 0) return ""
  text = substr(line, at + length(name) + 3)
  return substr(text, 1, index(text, "\"") - 1)
}

/<testcase / {
  name = attribute($0, "name")
  status = attribute($0, "status")
  file = results "/" name ".xml"
  cases = bad = ignored = 0
  while ((getline line < file) > 0) {
    if (line !~ /<testsuite /) continue
    cases += attribute(line, "tests")
    bad += attribute(line, "failures") + attribute(line, "errors")
    ignored += attribute(line, "skipped") + attribute(line, "disabled")
  }
  close(file)
  if (cases == 0) {
    # A test that was not run says why on the next line.
    if (status == "run") ++passed
    else if (status == "fail") ++failed
    next
  }
  if (status != "run" && bad == 0) {
    ++cases
    bad = 1
  }
  passed += cases - bad - ignored
  failed += bad
  skipped += ignored
}

/<skipped message=/ {
  if (cases > 0) next
  if (attribute($0, "message") ~ /^(SKIP_|Disabled)/) ++skipped
  else ++failed
}

END {
  printf "%d passed, %d failed", passed, failed
  if (skipped > 0) printf ", %d skipped", skipped
  printf "\n"
}
