// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/status.h>

#include "common/http_server/http_message.h"

namespace meshwright {

// Errors as REST tells them: problem details (RFC 9457) over absl::Status. What Status cannot say, the status of HTTP
// where it is not that of the code and the field that is to blame, travels as its payload.

// An error that names the field of the request, in camelCase, that is to blame.
absl::Status FieldError(const std::string& field, absl::Status status);
// An error with a status of HTTP of its own.
absl::Status HttpError(int http_status, absl::Status status);

// 400 for InvalidArgument, 404 for NotFound and so on; what HttpError said goes first.
int HttpStatusOf(const absl::Status& status);
// "about:blank", title, status, detail, code and, when it is known, field: said by FieldError, or the name that the
// message begins with ("weight is -1, expected ...").
std::string ProblemJson(const absl::Status& status);

// What the server says by itself, as a Status.
absl::Status StatusOfFault(const HttpFault& fault);

}  // namespace meshwright
