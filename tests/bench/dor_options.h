#pragma once

#include <CLI/CLI.hpp>

#include "core/dor/parameters.h"

namespace mapkeep {

/// Gives a bench one option for every parameter of dynamic object removal, each with the parameter's default. They are
/// written to `parameters`, which must outlive the parsing.
void AddDorOptions(CLI::App& app, DorParameters& parameters);

}  // namespace mapkeep
