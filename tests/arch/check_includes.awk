# SPDX-License-Identifier: Apache-2.0
# Reads file names on stdin and the table of rooms from `table`. Prints one line per broken rule and fails, or, with
# list=1, the graph of the rooms as it is: lines of code, the room, what it includes.

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

# The pattern of the list that covers the room; "" when none does.
function covering(list, target,    patterns, count, i, prefix) {
  count = split(list, patterns, " ")
  for (i = 1; i <= count; ++i) {
    if (patterns[i] == "*" || patterns[i] == target) return patterns[i]
    if (patterns[i] ~ /\/\*$/) {
      prefix = substr(patterns[i], 1, length(patterns[i]) - 1)
      if (index(target, prefix) == 1) return patterns[i]
    }
  }
  return ""
}

function complain(message) {
  print message
  ++errors
}

# Depth-first from a room; complains of the first circle that it closes.
function walk(room, path,    targets, count, i) {
  state[room] = "open"
  count = split(edges[room], targets, " ")
  for (i = 1; i <= count; ++i) {
    if (state[targets[i]] == "open") {
      sub("^.* " targets[i] " ->", " " targets[i] " ->", path)
      complain("a circle:" path " " room " -> " targets[i])
    } else if (state[targets[i]] == "") {
      walk(targets[i], path " " room " ->")
    }
  }
  state[room] = "done"
}

BEGIN {
  while ((getline line < table) > 0) {
    if (line ~ /^[ \t]*(#|$)/) continue
    split_at = index(line, ":")
    room = substr(line, 1, split_at - 1)
    gsub(/[ \t]/, "", room)
    if (split_at == 0 || room == "") { complain("rooms.txt: not 'room : rooms': " line); continue }
    if (room in rooms || (room == "@tests" && for_tests != "")) { complain("rooms.txt: two rows for " room); continue }
    if (room == "@tests") for_tests = substr(line, split_at + 1)
    else { rooms[room] = substr(line, split_at + 1); order[++rows] = room }
  }
}

{
  file = $0
  ++files
  room = room_of(file)
  if (room == "") { complain(file ": its folder is no room of tests/arch/rooms.txt"); next }
  list = rooms[room]
  is_test = file ~ /(_test|_benchmark|_testing|_conformance)\.(h|cc)$/
  top = room
  sub(/\/.*/, "", top)
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
      if (included ~ /\//) complain(file ":" number ": \"" included "\" is in no room of tests/arch/rooms.txt")
      else complain(file ":" number ": \"" included "\" is not rooted at the repository")
      continue
    }
    if (target == room) continue
    if (is_test && (pattern = covering(for_tests, target)) != "") {
      used["@tests", pattern] = 1
    } else if ((pattern = covering(list, target)) != "") {
      used[room, pattern] = 1
      if (!is_test && !((room, target) in seen)) { seen[room, target] = 1; edges[room] = edges[room] " " target }
    } else {
      complain(file ":" number ": " room " may not include " target " (\"" included "\")")
    }
  }
  close(file)
  lines[room] += number
  lines_of_top[top] += number
  all_lines += number
}

END {
  if (list_graph) {
    for (i = 1; i <= rows; ++i) if (lines[order[i]] > 0) printf "%6d %s ->%s\n", lines[order[i]], order[i], edges[order[i]]
    for (top in lines_of_top) printf "%5.1f%% %s\n", 100 * lines_of_top[top] / all_lines, top | "sort -rn"
    close("sort -rn")
  }
  for (i = 1; i <= rows; ++i) if (state[order[i]] == "") walk(order[i], "")
  if (!list_graph) {
    rooms["@tests"] = for_tests
    order[++rows] = "@tests"
    for (i = 1; i <= rows; ++i) {
      count = split(rooms[order[i]], patterns, " ")
      for (j = 1; j <= count; ++j) {
        if (!((order[i], patterns[j]) in used)) complain("rooms.txt: no file needs " order[i] " -> " patterns[j])
      }
    }
    for (top in lines_of_top) {
      if (max_share > 0 && lines_of_top[top] > max_share * all_lines) {
        complain(sprintf("%s has %d of %d lines, more than a third", top, lines_of_top[top], all_lines))
      }
    }
    if (files == 0) complain("no sources found")
    if (errors == 0) print includes " includes in " files " files keep to the table of rooms"
  }
  if (errors > 0 && !list_graph) { print errors " broken rules"; exit 1 }
}
