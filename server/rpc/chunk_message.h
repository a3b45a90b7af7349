#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace mapkeep {

/// The chunk in an UploadScansRequest that carries one and nothing else, in pieces that lie in the message's own:
/// nearly all that a robot sends, so it is worth not to be copied by a parser. Nothing if the message is anything else,
/// or not one: then it is for the parser.
std::optional<std::vector<std::string_view>> ChunkIn(std::span<const std::string_view> message);

}  // namespace mapkeep
