#pragma once

// Two large header-only libraries that every command group needs.
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
