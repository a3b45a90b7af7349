#include "core/scan_payload/draco_payload.h"

#include <absl/status/status.h>
#include <absl/strings/str_format.h>
#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <memory>

namespace mapkeep {
namespace {

constexpr int kMostBits = 30;  ///< of a quantised coordinate
constexpr int kSpeed = 7;      ///< 0 to 10: those below save nothing on scans and decode in up to three times the time

/// The first bytes of every payload of `count` points: Draco's header, and its description of the attributes. What
/// follows cannot ask for more memory than these do, so they are compared before Draco sees any of it.
std::string Preamble(uint32_t count) {
  std::string bytes = "DRACO";
  bytes += {2, 3, 0, 0, 0, 0};  // version 2.3, a point cloud, sequential, no flags
  bytes.append(reinterpret_cast<const char*>(&count), sizeof count);
  bytes += {1, 2};           // one group of two attributes
  bytes += {0, 9, 3, 0, 0};  // POSITION, float32, three of them, not normalised, id 0
  bytes += {4, 2, 1, 0, 1};  // GENERIC, uint8, one, not normalised, id 1
  bytes += {2, 1};           // quantised; integers
  return bytes;
}

absl::Status CheckPoint(size_t index, const Eigen::Vector3f& point, float intensity) {
  if (!point.allFinite()) return absl::InvalidArgumentError(absl::StrFormat("point %d is not finite", index));
  if (intensity >= 0 && intensity <= 1) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("point %d has intensity %g, expected a value in [0, 1]", index, intensity));
}

/// The grid that coordinates are counted in.
struct Grid {
  Eigen::Vector3f origin;
  int bits = 1;
  double range = 0;  ///< metres: 2^bits - 1 steps
};

absl::StatusOr<Grid> GridOf(const Scan& scan, double step) {
  Eigen::Vector3d low = scan.points.front().cast<double>(), high = low;
  for (const Eigen::Vector3f& point : scan.points) {
    low = low.cwiseMin(point.cast<double>());
    high = high.cwiseMax(point.cast<double>());
  }
  // A step lower than the lowest: as a float32, the corner must not come to lie above it.
  low = ((low / step).array().floor() - 1).matrix() * step;
  Grid grid{.origin = low.cast<float>()};
  const double extent = (high - grid.origin.cast<double>()).maxCoeff() + step;
  while (grid.bits <= kMostBits && (std::exp2(grid.bits) - 1) * step < extent) ++grid.bits;
  if (grid.bits > kMostBits) {
    return absl::InvalidArgumentError(
        absl::StrFormat("points %g m apart cannot be told in steps of %g m", extent, step));
  }
  grid.range = (std::exp2(grid.bits) - 1) * step;
  return grid;
}

draco::GeometryAttribute Attribute(draco::GeometryAttribute::Type type, int8_t components, draco::DataType data,
                                   int64_t stride) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, components, data, false, stride, 0);
  return attribute;
}

absl::StatusOr<Scan> Decode(std::string_view bytes, uint32_t count) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodePointCloudFromBuffer(&buffer);
  if (!decoded.ok()) {
    return absl::InvalidArgumentError(absl::StrFormat("Draco cannot read it: %s", decoded.status().error_msg_string()));
  }
  const draco::PointCloud& cloud = *decoded.value();
  const draco::PointAttribute* positions = cloud.GetAttributeByUniqueId(0);
  const draco::PointAttribute* intensities = cloud.GetAttributeByUniqueId(1);
  if (buffer.remaining_size() != 0) return absl::InvalidArgumentError("bytes after the end of the Draco bitstream");
  const auto whole = [count](const draco::PointAttribute* attribute, draco::DataType data, int8_t components) {
    return attribute != nullptr && attribute->size() == count && attribute->is_mapping_identity() &&
           attribute->data_type() == data && attribute->num_components() == components;
  };
  if (cloud.num_points() != count || !whole(positions, draco::DT_FLOAT32, 3) ||
      !whole(intensities, draco::DT_UINT8, 1)) {
    return absl::InvalidArgumentError(absl::StrFormat("Draco finds something else than %d points in it", count));
  }
  Scan scan;
  scan.points.resize(count);
  scan.intensities.resize(count);
  for (uint32_t i = 0; i < count; ++i) {
    const draco::AttributeValueIndex index(i);
    positions->GetValue(index, scan.points[i].data());
    uint8_t intensity = 0;
    intensities->GetValue(index, &intensity);
    scan.intensities[i] = static_cast<float>(intensity) / 255.F;
  }
  return scan;
}

}  // namespace

absl::StatusOr<std::string> EncodeDraco(const Scan& scan, double step) {
  if (scan.points.empty()) return absl::InvalidArgumentError("the scan has no points");
  const auto count = static_cast<uint32_t>(scan.points.size());
  draco::PointCloud cloud;
  cloud.set_num_points(count);
  const int positions = cloud.AddAttribute(
      Attribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32, 3 * sizeof(float)), true, count);
  const int intensities =
      cloud.AddAttribute(Attribute(draco::GeometryAttribute::GENERIC, 1, draco::DT_UINT8, 1), true, count);
  for (uint32_t i = 0; i < count; ++i) {
    const float intensity = scan.intensities.empty() ? 0.F : scan.intensities[i];
    if (absl::Status status = CheckPoint(i, scan.points[i], intensity); !status.ok()) return status;
    const draco::AttributeValueIndex index(i);
    cloud.attribute(positions)->SetAttributeValue(index, scan.points[i].data());
    const auto level = static_cast<uint8_t>(std::lround(255 * intensity));
    cloud.attribute(intensities)->SetAttributeValue(index, &level);
  }
  const absl::StatusOr<Grid> grid = GridOf(scan, step);
  if (!grid.ok()) return grid.status();

  draco::ExpertEncoder encoder(cloud);
  encoder.SetEncodingMethod(draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
  encoder.SetSpeedOptions(kSpeed, kSpeed);
  encoder.SetAttributeExplicitQuantization(positions, grid->bits, 3, grid->origin.data(),
                                           static_cast<float>(grid->range));
  // The intensity of a point says little about the next one's: differences take more bits than values.
  if (!encoder.SetAttributePredictionScheme(intensities, draco::PREDICTION_NONE).ok()) {
    return absl::InternalError("Draco refuses to leave intensities as they are");
  }
  draco::EncoderBuffer buffer;
  if (const draco::Status status = encoder.EncodeToBuffer(&buffer); !status.ok()) {
    return absl::InternalError(absl::StrFormat("Draco cannot write it: %s", status.error_msg_string()));
  }
  std::string bytes(buffer.data(), buffer.size());
  if (!bytes.starts_with(Preamble(count))) return absl::InternalError("this Draco writes another format than 2.3");
  return bytes;
}

absl::StatusOr<Scan> DecodeDraco(std::string_view bytes, uint32_t count) {
  const std::string preamble = Preamble(count);
  const auto [in_bytes, expected] = std::mismatch(bytes.begin(), bytes.end(), preamble.begin(), preamble.end());
  if (expected != preamble.end()) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "not a Draco 2.3 point cloud of %d positions and intensities by the sequential encoder: byte %d is another",
        count, expected - preamble.begin()));
  }
  // Draco answers bad bytes with errors, but asks the standard library for memory as it goes.
  try {
    return Decode(bytes, count);
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(absl::StrFormat("Draco cannot read it: %s", error.what()));
  }
}

}  // namespace mapkeep
