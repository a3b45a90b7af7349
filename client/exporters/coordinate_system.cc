#include "client/exporters/coordinate_system.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <proj.h>

#include <cmath>
#include <memory>

namespace mapkeep {
namespace {

using Context = std::unique_ptr<PJ_CONTEXT, decltype([](PJ_CONTEXT* context) { proj_context_destroy(context); })>;
using Object = std::unique_ptr<PJ, decltype([](PJ* object) { proj_destroy(object); })>;

bool IsInMetres(PJ_CONTEXT* context, const PJ* horizontal) {
  const Object axes(proj_crs_get_coordinate_system(context, horizontal));
  if (axes == nullptr) return false;
  for (int axis = 0; axis < 2; ++axis) {
    double factor = 0;
    const char* unit = nullptr;
    if (proj_cs_get_axis_info(context, axes.get(), axis, nullptr, nullptr, nullptr, &factor, &unit, nullptr, nullptr) ==
        0) {
      return false;
    }
    if (factor != 1 || unit == nullptr || std::string_view(unit) != "metre") return false;
  }
  return true;
}

}  // namespace

absl::StatusOr<std::string> WellKnownTextOf(const std::string& crs) {
  const Context context(proj_context_create());
  proj_log_level(context.get(), PJ_LOG_NONE);
  const Object system(proj_create(context.get(), crs.c_str()));
  if (system == nullptr || proj_is_crs(system.get()) == 0) {
    return absl::FailedPreconditionError(absl::StrCat("PROJ knows no coordinate reference system ", crs));
  }
  // Of a horizontal with a vertical system the first part is the horizontal one.
  const Object horizontal(proj_get_type(system.get()) == PJ_TYPE_COMPOUND_CRS
                              ? proj_crs_get_sub_crs(context.get(), system.get(), 0)
                              : proj_clone(context.get(), system.get()));
  if (horizontal == nullptr || !IsInMetres(context.get(), horizontal.get())) {
    return absl::FailedPreconditionError(
        absl::StrCat(crs, " does not measure in metres, as a map's coordinates do: expected a projected system"));
  }
  const char* const options[] = {"MULTILINE=NO", nullptr};
  const char* text = proj_as_wkt(context.get(), system.get(), PJ_WKT1_GDAL, options);
  if (text == nullptr) return absl::FailedPreconditionError(absl::StrCat(crs, " has no well-known text of version 1"));
  return std::string(text);
}

}  // namespace mapkeep
