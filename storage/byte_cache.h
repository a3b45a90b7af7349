#pragma once

#include <absl/container/flat_hash_map.h>

#include <array>
#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <utility>

namespace mapkeep {

/// Decoded values by name, the least recently used ones dropped beyond a limit in bytes. Values are immutable, so what
/// is here is never stale. Thread-safe.
template <typename Name, typename Value>
class ByteCache {
 public:
  explicit ByteCache(size_t limit_bytes) : shard_limit_(limit_bytes / kShards) {}

  /// The value, or nullptr.
  std::shared_ptr<const Value> Find(const Name& name) {
    Shard& shard = ShardOf(name);
    const std::scoped_lock lock(shard.mutex);
    const auto found = shard.by_name.find(name);
    if (found == shard.by_name.end()) return nullptr;
    shard.newest_first.splice(shard.newest_first.begin(), shard.newest_first, found->second);
    return found->second->value;
  }

  void Insert(const Name& name, std::shared_ptr<const Value> value, size_t bytes) {
    Shard& shard = ShardOf(name);
    const std::scoped_lock lock(shard.mutex);
    if (bytes > shard_limit_ || shard.by_name.contains(name)) return;
    shard.newest_first.push_front({name, std::move(value), bytes});
    shard.by_name.emplace(name, shard.newest_first.begin());
    shard.bytes += bytes;
    while (shard.bytes > shard_limit_) {
      const Entry& oldest = shard.newest_first.back();
      shard.bytes -= oldest.bytes;
      shard.by_name.erase(oldest.name);
      shard.newest_first.pop_back();
    }
  }

 private:
  static constexpr size_t kShards = 16;

  struct Entry {
    Name name;
    std::shared_ptr<const Value> value;
    size_t bytes = 0;
  };
  struct Shard {
    std::mutex mutex;
    std::list<Entry> newest_first;
    absl::flat_hash_map<Name, typename std::list<Entry>::iterator> by_name;
    size_t bytes = 0;
  };

  Shard& ShardOf(const Name& name) { return shards_[absl::Hash<Name>()(name) >> 7 & (kShards - 1)]; }

  const size_t shard_limit_;
  std::array<Shard, kShards> shards_;
};

}  // namespace mapkeep
