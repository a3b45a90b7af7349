#pragma once

#include <absl/container/flat_hash_map.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <utility>

#include "storage/cache_use.h"

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
    if (found == shard.by_name.end()) {
      ++shard.misses;
      return nullptr;
    }
    ++shard.hits;
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

  CacheUse Use() const {
    CacheUse use;
    for (const Shard& shard : shards_) {
      const std::scoped_lock lock(shard.mutex);
      use.hits += shard.hits;
      use.misses += shard.misses;
      use.bytes += shard.bytes;
    }
    return use;
  }

 private:
  static constexpr size_t kShards = 16;

  struct Entry {
    Name name;
    std::shared_ptr<const Value> value;
    size_t bytes = 0;
  };
  struct Shard {
    mutable std::mutex mutex;
    uint64_t hits = 0, misses = 0;
    std::list<Entry> newest_first;
    absl::flat_hash_map<Name, typename std::list<Entry>::iterator> by_name;
    size_t bytes = 0;
  };

  Shard& ShardOf(const Name& name) { return shards_[absl::Hash<Name>()(name) >> 7 & (kShards - 1)]; }

  const size_t shard_limit_;
  std::array<Shard, kShards> shards_;
};

}  // namespace mapkeep
