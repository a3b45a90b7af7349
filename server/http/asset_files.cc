#include "server/http/asset_files.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "server/http/content_coding.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostBytes = size_t{64} << 20;

std::string ContentTypeOf(const fs::path& file) {
  static const auto* const types = new std::map<std::string, std::string>{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".map", "application/json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".webp", "image/webp"},
      {".ico", "image/x-icon"},
      {".wasm", "application/wasm"},
      {".woff2", "font/woff2"},
      {".txt", "text/plain; charset=utf-8"},
      {".webmanifest", "application/manifest+json"},
  };
  const auto found = types->find(file.extension().string());
  return found == types->end() ? "application/octet-stream" : found->second;
}

}  // namespace

absl::StatusOr<AssetFiles> AssetFiles::Read(const std::string& directory) {
  AssetFiles assets;
  size_t total = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator at(directory, error), end; !error && at != end; at.increment(error)) {
    if (!at->is_regular_file(error)) continue;
    const fs::path& path = at->path();
    std::ifstream in(path, std::ios::binary);
    auto plain =
        std::make_shared<const std::string>(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    if (!in) return absl::UnavailableError(absl::StrCat("cannot read ", path.string()));
    total += plain->size();
    if (total > kMostBytes) return absl::ResourceExhaustedError(absl::StrCat(directory, ": more than 64 MiB of files"));
    const std::string name = fs::relative(path, directory, error).generic_string();
    File file{.content_type = ContentTypeOf(path)};
    // The bundler puts a hash of the content into the names of what it makes, and of nothing else.
    if (absl::StartsWith(name, "assets/")) file.keep = Keep::kForever;
    const auto changed = fs::last_write_time(path, error).time_since_epoch().count();
    file.tag = absl::StrCat(absl::Hex(static_cast<uint64_t>(changed)), "-", absl::Hex(plain->size()));
    for (const Coding coding : {Coding::kGzip, Coding::kZstd}) {
      auto packed = std::make_shared<const std::string>(Packed(*plain, coding));
      if (packed->size() < plain->size() / 10 * 9) file.bodies[coding] = std::move(packed);
    }
    file.bodies[Coding::kIdentity] = std::move(plain);
    assets.files_[name] = std::move(file);
  }
  if (error) return absl::UnavailableError(absl::StrCat("cannot read ", directory, ": ", error.message()));
  if (!assets.files_.contains("index.html")) {
    return absl::NotFoundError(absl::StrCat("there is no index.html in ", directory));
  }
  return assets;
}

PageResponse AssetFiles::Find(const PageRequest& request, const std::vector<std::string>& path) const {
  const auto found = files_.find(absl::StrJoin(path, "/"));
  if (found == files_.end()) {
    return ErrorPage(empty() ? absl::NotFoundError("the viewer is not installed: see the setting http_assets")
                             : absl::NotFoundError("there is no such page"));
  }
  const File& file = found->second;
  Coding coding = request.range.empty() ? BestCoding(request.accept_encoding) : Coding::kIdentity;
  if (!file.bodies.contains(coding)) coding = Coding::kIdentity;
  PageResponse page{.content_type = file.content_type,
                    .content_coding = NameOf(coding),
                    .body = file.bodies.at(coding),
                    .etag = EntityTag(file.tag, coding),
                    .keep = file.keep};
  if (NamesTag(request.if_none_match, page.etag)) {
    page.status = 304;
    return page;
  }
  ApplyRange(request, page);
  return page;
}

}  // namespace mapkeep
