// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/sql_database.h"

#include <absl/strings/numbers.h>

#include "common/base/check.h"

namespace meshwright {

int64_t SqlRow::Integer(size_t column) const {
  int64_t value = 0;
  if (!absl::SimpleAtoi(values_[column], &value)) return 0;
  return value;
}

std::map<std::string, std::string> ParseSqlStatements(const std::vector<std::pair<std::string, std::string>>& files) {
  const std::string marker = "-- name: ";
  std::map<std::string, std::string> statements;
  for (const auto& [file, text] : files) {
    size_t at = text.find(marker);
    while (at != std::string::npos) {
      const size_t name_begin = at + marker.size();
      const size_t name_end = text.find('\n', name_begin);
      MW_CHECK(name_end != std::string::npos);
      at = text.find(marker, name_end);
      const bool is_new = statements
                              .emplace(text.substr(name_begin, name_end - name_begin),
                                       text.substr(name_end, at == std::string::npos ? at : at - name_end))
                              .second;
      MW_CHECK(is_new);
    }
  }
  return statements;
}

}  // namespace meshwright
