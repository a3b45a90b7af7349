#include "storage/overlay_engine.h"

#include <set>

#include "storage/text.h"

namespace mapkeep {
namespace {

bool IsBefore(std::string_view key, std::string_view end) { return end.empty() || key < end; }

}  // namespace

OverlayEngine::Changes OverlayEngine::ChangesOf(const ChangesByName& all, std::string_view name) {
  const auto found = all.find(name);
  return found == all.end() ? Changes() : found->second;
}

absl::StatusOr<std::optional<std::string>> OverlayEngine::Get(std::string_view partition, std::string_view key) const {
  const std::scoped_lock lock(mutex_);
  if (const auto changes = rows_.find(partition); changes != rows_.end()) {
    if (const auto found = changes->second.find(key); found != changes->second.end()) return found->second;
  }
  return engine_.Get(partition, key);
}

absl::Status OverlayEngine::Scan(std::string_view partition, std::string_view begin, std::string_view end,
                                 const std::function<bool(std::string_view, std::string_view)>& row) const {
  const std::scoped_lock lock(mutex_);
  const Changes changes = ChangesOf(rows_, partition);
  auto next = changes.lower_bound(begin);
  bool going = true;
  // Rows that are new here come before the first of below that is not before them.
  const auto catch_up = [&](std::optional<std::string_view> key) {
    for (; going && next != changes.end() && IsBefore(next->first, end) && (!key || next->first < *key); ++next) {
      if (next->second) going = row(next->first, *next->second);
    }
  };
  const absl::Status scanned = engine_.Scan(partition, begin, end, [&](std::string_view key, std::string_view value) {
    catch_up(key);
    if (!going) return false;
    if (next != changes.end() && next->first == key) {
      if (next->second) going = row(key, *next->second);
      ++next;
    } else {
      going = row(key, value);
    }
    return going;
  });
  if (!scanned.ok()) return scanned;
  catch_up(std::nullopt);
  return absl::OkStatus();
}

absl::Status OverlayEngine::Write(std::string_view partition, std::span<const Mutation> mutations, Durability) {
  const std::scoped_lock lock(mutex_);
  Changes& changes = rows_[std::string(partition)];
  for (const Mutation& mutation : mutations) changes[mutation.key] = mutation.value;
  return absl::OkStatus();
}

absl::Status OverlayEngine::CompareAndSet(std::string_view partition, std::span<const Condition> conditions,
                                          std::span<const Mutation> mutations) {
  const std::scoped_lock lock(mutex_);
  for (const Condition& condition : conditions) {
    const absl::StatusOr<std::optional<std::string>> found = Get(partition, condition.key);
    if (!found.ok()) return found.status();
    if (*found != condition.value) return absl::AbortedError(Text("row ", condition.key, " has changed"));
  }
  return Write(partition, mutations, Durability::kDurable);
}

absl::Status OverlayEngine::PutValues(std::string_view group, std::span<const ImmutableValue> values) {
  const std::scoped_lock lock(mutex_);
  Changes& changes = values_[std::string(group)];
  for (const ImmutableValue& value : values) changes[value.key] = value.value;
  return absl::OkStatus();
}

absl::StatusOr<std::string> OverlayEngine::GetValue(std::string_view group, std::string_view key) const {
  const std::scoped_lock lock(mutex_);
  if (const auto changes = values_.find(group); changes != values_.end()) {
    if (const auto found = changes->second.find(key); found != changes->second.end()) {
      if (found->second) return *found->second;
      return absl::NotFoundError(Text("value ", key, " is deleted"));
    }
  }
  return engine_.GetValue(group, key);
}

absl::Status OverlayEngine::DeleteValues(std::string_view group, std::span<const std::string> keys) {
  const std::scoped_lock lock(mutex_);
  Changes& changes = values_[std::string(group)];
  for (const std::string& key : keys) changes[key] = std::nullopt;
  return absl::OkStatus();
}

absl::Status OverlayEngine::ScanValueKeys(std::string_view group, std::string_view begin, std::string_view end,
                                          const std::function<bool(std::string_view)>& row) const {
  const std::scoped_lock lock(mutex_);
  const Changes changes = ChangesOf(values_, group);
  std::set<std::string, std::less<>> keys;
  const absl::Status scanned = engine_.ScanValueKeys(group, begin, end, [&keys](std::string_view key) {
    keys.emplace(key);
    return true;
  });
  if (!scanned.ok()) return scanned;
  for (auto change = changes.lower_bound(begin); change != changes.end() && IsBefore(change->first, end); ++change) {
    if (change->second) {
      keys.insert(change->first);
    } else {
      keys.erase(change->first);
    }
  }
  for (const std::string& key : keys) {
    if (!row(key)) break;
  }
  return absl::OkStatus();
}

absl::Status OverlayEngine::Checkpoint(const std::string&) {
  return absl::UnimplementedError("what is only tried out is not copied");
}

}  // namespace mapkeep
