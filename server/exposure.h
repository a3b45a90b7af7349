#pragma once

#include <absl/status/status.h>

#include <string_view>

#include "server/config.h"

namespace mapkeep {

/// Whether only this machine reaches an address: 127.0.0.0/8, ::1 or "localhost". Other names are not looked up.
bool IsLoopback(std::string_view host);

/// What no daemon should be started with by mistake: a listener that other machines reach without TLS or without tokens
/// (unless `insecure` says so), half of a certificate, client certificates without TLS. INVALID_ARGUMENT naming the
/// listener and what would do.
absl::Status CheckExposure(const Config& config);

}  // namespace mapkeep
