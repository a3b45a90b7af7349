// The daemon's configuration file.

#include <cstdint>
#include <string>

#include "server/command_line.h"
#include "server/config.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  mapkeep::Config config;
  mapkeep::ApplyToml(std::string(reinterpret_cast<const char*>(data), size), "fuzz.toml", config).IgnoreError();
  return 0;
}
