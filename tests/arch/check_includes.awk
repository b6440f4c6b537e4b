# Reads file names on stdin and the table of rooms from `table`. Prints one line per forbidden include.

function room_of(path,    parts, count, i, candidate, best) {
  # The longest prefix of the path that is a room.
  count = split(path, parts, "/")
  candidate = ""
  best = ""
  for (i = 1; i < count; ++i) {
    candidate = (i == 1) ? parts[1] : candidate "/" parts[i]
    if (candidate in rooms) best = candidate
  }
  return best
}

function allowed(list, target,    patterns, count, i, prefix) {
  count = split(list, patterns, " ")
  for (i = 1; i <= count; ++i) {
    if (patterns[i] == "*" || patterns[i] == target) return 1
    if (patterns[i] ~ /\/\*$/) {
      prefix = substr(patterns[i], 1, length(patterns[i]) - 1)
      if (index(target, prefix) == 1) return 1
    }
  }
  return 0
}

BEGIN {
  while ((getline line < table) > 0) {
    if (line ~ /^[ \t]*(#|$)/) continue
    split_at = index(line, ":")
    room = substr(line, 1, split_at - 1)
    gsub(/[ \t]/, "", room)
    if (split_at == 0 || room == "") { print "rooms.txt: not 'room : rooms': " line; ++errors; continue }
    if (room == "@tests") for_tests = substr(line, split_at + 1)
    else rooms[room] = substr(line, split_at + 1)
  }
}

{
  file = $0
  ++files
  room = room_of(file)
  if (room == "") { print file ": its folder is no room of tests/arch/rooms.txt"; ++errors; next }
  list = rooms[room]
  if (file ~ /(_test|_benchmark|_testing|_conformance)\.(h|cc)$/) list = list " " for_tests
  number = 0
  while ((getline line < file) > 0) {
    ++number
    if (line !~ /^[ \t]*#[ \t]*include[ \t]*"/) continue
    included = line
    sub(/^[^"]*"/, "", included)
    sub(/".*$/, "", included)
    target = room_of(included)
    ++includes
    if (target == "") {
      if (included ~ /\//) print file ":" number ": \"" included "\" is in no room of tests/arch/rooms.txt"
      else print file ":" number ": \"" included "\" is not rooted at the repository"
      ++errors
    } else if (target != room && !allowed(list, target)) {
      print file ":" number ": " room " may not include " target " (\"" included "\")"
      ++errors
    }
  }
  close(file)
}

END {
  if (errors > 0) { print errors " forbidden"; exit 1 }
  if (files == 0) { print "no sources found"; exit 1 }
  print includes " includes in " files " files keep to the table of rooms"
}
