// The file of tokens, and a token that a caller sends. Input: the token, ended by a zero byte, then the file.

#include <cstdint>
#include <string_view>

#include "server/auth/token_table.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view input(reinterpret_cast<const char*>(data), size);
  const size_t end = std::min(input.find('\0'), input.size());
  const auto table = mapkeep::TokenTable::Parse(input.substr(std::min(end + 1, input.size())), "tokens");
  if (table.ok()) table->Find(input.substr(0, end));
  return 0;
}
