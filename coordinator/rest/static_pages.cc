// SPDX-License-Identifier: Apache-2.0
#include "coordinator/rest/static_pages.h"

#include <array>
#include <filesystem>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "common/base/digest.h"
#include "common/base/files.h"
#include "common/base/status_macros.h"
#include "coordinator/rest/downloads.h"

namespace meshwright {
namespace {

namespace fs = std::filesystem;

struct ContentType {
  const char* ending;
  const char* type;
};
constexpr std::array<ContentType, 15> kContentTypes = {{{".html", "text/html; charset=utf-8"},
                                                        {".js", "text/javascript; charset=utf-8"},
                                                        {".mjs", "text/javascript; charset=utf-8"},
                                                        {".css", "text/css; charset=utf-8"},
                                                        {".json", "application/json"},
                                                        {".map", "application/json"},
                                                        {".webmanifest", "application/manifest+json"},
                                                        {".svg", "image/svg+xml"},
                                                        {".png", "image/png"},
                                                        {".jpg", "image/jpeg"},
                                                        {".ico", "image/x-icon"},
                                                        {".woff2", "font/woff2"},
                                                        {".wasm", "application/wasm"},
                                                        {".txt", "text/plain; charset=utf-8"},
                                                        {".glb", "model/gltf-binary"}}};

// Compiling WebAssembly is for the decoder of compressed tiles.
constexpr char kPolicy[] =
    "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; img-src 'self' blob: data:; style-src 'self' "
    "'unsafe-inline'; worker-src 'self' blob:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'self'";

constexpr char kNoPage[] =
    "This is Meshwright's coordinator. The page is not installed here (scripts/build-dashboard makes it); the "
    "interface "
    "is at /v1, described by /v1/openapi.yaml.\n";

const char* TypeOf(const std::string& path) {
  for (const ContentType& known : kContentTypes) {
    if (absl::EndsWith(path, known.ending)) return known.type;
  }
  return "application/octet-stream";
}

// No empty part, none that begins with a dot: such files are nobody's business, and ".." leads out.
bool IsPlain(const std::string& path) {
  if (path.find('\0') != std::string::npos || path.find('\\') != std::string::npos) return false;
  for (const auto& part : absl::StrSplit(path, '/')) {
    if (part.empty() || part[0] == '.') return false;
  }
  return true;
}

// Symbolic links do not lead out either.
bool LiesBelow(const fs::path& file, const fs::path& folder) {
  std::error_code error;
  const fs::path real = fs::canonical(file, error);
  if (error) return false;
  const fs::path root = fs::canonical(folder, error);
  return !error && absl::StartsWith(real.string(), root.string() + "/") && fs::is_regular_file(real, error);
}

}  // namespace

absl::Status SendPage(RestCall& call, const std::string& folder) {
  const std::string path = call.request.path.empty() ? "" : call.request.path.substr(1);
  if (folder.empty() || !LiesBelow(folder + "/index.html", folder)) {
    if (!path.empty()) return absl::NotFoundError("there is nothing at this path");
    call.response.status = 200;
    call.response.SetContent(kNoPage, "text/plain; charset=utf-8");
    return absl::OkStatus();
  }
  std::string file = path.empty() ? "index.html" : path;
  const bool plain = IsPlain(file);
  if (!plain || !LiesBelow(absl::StrCat(folder, "/", file), folder)) {
    // A path of the page has no ending; a file that is missing must not become a page.
    const size_t name = path.rfind('/') == std::string::npos ? 0 : path.rfind('/') + 1;
    if (!plain || path.find('.', name) != std::string::npos) {
      return absl::NotFoundError("there is nothing at this path");
    }
    file = "index.html";
  }
  MW_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(absl::StrCat(folder, "/", file)));
  const std::string etag = Sha256Hex(bytes).substr(0, 32);
  call.response.headers.Set("ETag", absl::StrCat("\"", etag, "\""));
  call.response.headers.Set("Cache-Control",
                            absl::StartsWith(file, "assets/") ? "public, max-age=31536000, immutable" : "no-cache");
  call.response.headers.Set("Content-Security-Policy", kPolicy);
  if (HasCopy(call, etag)) {
    call.response.status = 304;
    return absl::OkStatus();
  }
  call.response.status = 200;
  call.response.SetContent(bytes, TypeOf(file));
  return absl::OkStatus();
}

}  // namespace meshwright
