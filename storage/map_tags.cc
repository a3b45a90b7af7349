#include <algorithm>
#include <utility>

#include "storage/map_store_state.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr int kTries = 64;
constexpr size_t kMostTags = 1000;  ///< one row holds them all

/// What a change of the tags makes of them: false if nothing is to change.
using TagChange = std::function<absl::StatusOr<bool>(Tags& tags, const EpochState& head, uint64_t oldest)>;

/// Changes the tags by compare-and-set. A tag on an epoch that may be opened requires the oldest one unchanged: the
/// collector raises it before it reads the tags, so that it sees the tag or the tag is refused.
absl::Status ChangeTags(Engine& engine, uint64_t incarnation, const TagChange& change) {
  const std::string partition = HeadPartition(incarnation);
  absl::Status last;
  for (int i = 0; i < kTries; ++i) {
    const auto head = ReadRow(engine, partition, kHeadRow, DecodeEpoch);
    if (!head.ok()) return head.status();
    if (!*head) return absl::NotFoundError("the map is being deleted");
    const auto map = engine.Get(partition, kMapRow);
    if (!map.ok()) return map.status();
    if (!*map) return absl::NotFoundError("the map is being deleted");
    const auto oldest = ReadRow(engine, partition, kOldestRow, DecodeNumber);
    if (!oldest.ok()) return oldest.status();
    const auto row = ReadRow(engine, partition, kTagsRow, DecodeTags);
    if (!row.ok()) return row.status();
    Tags tags = *row ? (*row)->value : Tags();
    const absl::StatusOr<bool> changed = change(tags, (*head)->value, *oldest ? (*oldest)->value : 0);
    if (!changed.ok()) return changed.status();
    if (!*changed) return absl::OkStatus();
    const std::vector<Condition> conditions = {{std::string(kMapRow), **map},
                                               {std::string(kOldestRow), BytesOf(*oldest)},
                                               {std::string(kTagsRow), BytesOf(*row)}};
    const std::vector<Mutation> mutations = {{std::string(kTagsRow), EncodeRow(tags)}};
    last = engine.CompareAndSet(partition, conditions, mutations);
    // Applied or not, the next turn sees it.
    if (last.ok() || !(absl::IsAborted(last) || absl::IsUnknown(last) || absl::IsDeadlineExceeded(last))) return last;
  }
  return last;
}

}  // namespace

absl::StatusOr<Tags> ReadTags(const Engine& engine, uint64_t incarnation) {
  const auto row = ReadRow(engine, HeadPartition(incarnation), kTagsRow, DecodeTags);
  if (!row.ok()) return row.status();
  return *row ? (*row)->value : Tags();
}

absl::StatusOr<std::vector<Tag>> MapStore::Tags(std::string_view map) const {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(state_->engine, map);
  if (!incarnation.ok()) return incarnation.status();
  absl::StatusOr<mapkeep::Tags> tags = ReadTags(state_->engine, *incarnation);
  if (!tags.ok()) return tags.status();
  return std::move(tags->tags);
}

absl::StatusOr<Tag> MapStore::AddTag(std::string_view map, std::string_view name, std::optional<uint64_t> epoch) {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(state_->engine, map);
  if (!incarnation.ok()) return incarnation.status();
  Tag given{std::string(name), 0, state_->options.now()};
  std::optional<uint64_t> chosen = epoch;
  const absl::Status added = ChangeTags(
      state_->engine, *incarnation,
      [&](mapkeep::Tags& tags, const EpochState& head, uint64_t oldest) -> absl::StatusOr<bool> {
        if (!chosen) chosen = head.epoch;  // also if a try that went unanswered came through
        given.epoch = *chosen;
        const auto found = std::ranges::find(tags.tags, name, &Tag::name);
        if (found != tags.tags.end()) {
          if (found->epoch != given.epoch) {
            return absl::AlreadyExistsError(Text("tag ", name, " names epoch ", found->epoch));
          }
          given = *found;
          return false;
        }
        if (given.epoch > head.epoch) {
          return absl::NotFoundError(Text("map ", map, " has no epoch ", given.epoch, ": its newest is ", head.epoch));
        }
        if (given.epoch < oldest && !IsTagged(tags, given.epoch)) {
          return absl::FailedPreconditionError(
              Text("epoch ", given.epoch, " is collected: the oldest one kept is ", oldest));
        }
        if (tags.tags.size() >= kMostTags) {
          return absl::ResourceExhaustedError(Text("map ", map, " has ", kMostTags, " tags, the most it may have"));
        }
        tags.tags.push_back(given);
        std::ranges::sort(tags.tags, {}, &Tag::name);
        return true;
      });
  if (!added.ok()) return added;
  return given;
}

absl::Status MapStore::RemoveTag(std::string_view map, std::string_view name) {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(state_->engine, map);
  if (!incarnation.ok()) return incarnation.status();
  bool seen = false;
  return ChangeTags(state_->engine, *incarnation,
                    [&](mapkeep::Tags& tags, const EpochState&, uint64_t) -> absl::StatusOr<bool> {
                      const auto found = std::ranges::find(tags.tags, name, &Tag::name);
                      if (found == tags.tags.end()) {
                        if (seen) return false;  // a try that went unanswered came through
                        return absl::NotFoundError(Text("map ", map, " has no tag ", name));
                      }
                      seen = true;
                      tags.tags.erase(found);
                      return true;
                    });
}

}  // namespace mapkeep
