#pragma once

#include <functional>

namespace mapkeep {

/// Told how far a long operation is, in [0, 1] and never falling; returns false to stop it, after which the operation
/// returns CANCELLED. May be called from any thread, never from two at once. Empty: nobody is listening.
using Progress = std::function<bool(double fraction)>;

}  // namespace mapkeep
