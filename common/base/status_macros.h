// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#define MW_STATUS_CONCAT_INNER(a, b) a##b
#define MW_STATUS_CONCAT(a, b) MW_STATUS_CONCAT_INNER(a, b)

// NOLINTBEGIN(bugprone-macro-parentheses): declarations and statements cannot be put in parentheses.

// Returns from the enclosing function when `expression` (an absl::Status) is not OK.
#define MW_RETURN_IF_ERROR(expression)                                            \
  do {                                                                            \
    if (absl::Status mw_status = (expression); !mw_status.ok()) return mw_status; \
  } while (false)

// MW_ASSIGN_OR_RETURN(auto x, F()): `F` returns an absl::StatusOr; returns its status when it is not OK.
#define MW_ASSIGN_OR_RETURN(declaration, expression) \
  MW_ASSIGN_OR_RETURN_INNER(MW_STATUS_CONCAT(mw_status_or_, __LINE__), declaration, expression)
#define MW_ASSIGN_OR_RETURN_INNER(name, declaration, expression) \
  auto name = (expression);                                      \
  if (!name.ok()) return std::move(name).status();               \
  declaration = std::move(name).value()

// NOLINTEND(bugprone-macro-parentheses)
