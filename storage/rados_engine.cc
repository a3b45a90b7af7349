#include "storage/rados_engine.h"

#include <absl/strings/escaping.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <rados/librados.hpp>
#include <set>
#include <utility>
#include <vector>

#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr size_t kMaxNameLength = 1000;
constexpr uint64_t kRowsAtOnce = 1000;           // of one read; OSDs give at most 1,024
constexpr size_t kBatchBytes = size_t{4} << 20;  // of one object of values
constexpr int kTries = 64;
constexpr char kPresent = '=';            // before the value of every row
constexpr std::string_view kBatch = "#";  // before the name of a batch in a group's index
constexpr std::string_view kValue = "$";  // before the key of a value there

using librados::bufferlist;
using Rows = std::map<std::string, bufferlist>;

enum class Direction { kRead, kWrite };

absl::Status FromRados(int code, Direction direction, std::string_view what) {
  if (code >= 0) return absl::OkStatus();
  const std::string message = Text(what, ": ", std::strerror(-code));
  switch (-code) {
    case ETIMEDOUT:
      if (direction == Direction::kRead) return absl::UnavailableError(message);
      return absl::DeadlineExceededError(message);
    case ENOSPC:
    case EDQUOT:
      return absl::ResourceExhaustedError(message);
    case ENOENT:
      return absl::NotFoundError(message);
    case EIO:
      return absl::DataLossError(message);
    case EACCES:
    case EPERM:
      return absl::PermissionDeniedError(message);
    case EINVAL:
    case ENAMETOOLONG:
    case EFBIG:
      return absl::InvalidArgumentError(message);
    case ESHUTDOWN:
    case ENOTCONN:
    case EAGAIN:
      return absl::UnavailableError(message);
    default:
      // Of a write it is not said that nothing was applied.
      return direction == Direction::kRead ? absl::InternalError(message) : absl::UnknownError(message);
  }
}

bufferlist BufferOf(std::string_view bytes) {
  bufferlist buffer;
  buffer.append(bytes.data(), static_cast<unsigned>(bytes.size()));
  return buffer;
}

bufferlist RowValue(std::string_view value) {
  bufferlist buffer;
  buffer.append(kPresent);
  buffer.append(value.data(), static_cast<unsigned>(value.size()));
  return buffer;
}

std::string ValueOfRow(const bufferlist& row) {
  std::string value = row.to_str();
  value.erase(0, 1);
  return value;
}

absl::Status CheckName(std::string_view name) {
  if (!name.empty() && name.size() <= kMaxNameLength) return absl::OkStatus();
  return absl::InvalidArgumentError(
      Text("the name of a partition or group has ", name.size(), " bytes, not 1 to ", kMaxNameLength));
}

std::string Describe(std::string_view action, std::string_view partition) {
  return Text(action, " ", absl::Utf8SafeCEscape(ToAbsl(partition)));
}

std::string RowsObject(std::string_view partition) { return Text("rows/", partition); }
std::string IndexObject(std::string_view group) { return Text("index/", group); }
std::string BatchObject(std::string_view group, std::string_view batch) { return Text("values/", group, "/", batch); }

/// Where a value lies: in the index as "offset length batch".
struct Place {
  uint64_t offset = 0, length = 0;
  std::string batch;
};

bufferlist Encode(const Place& place) { return BufferOf(Text(place.offset, " ", place.length, " ", place.batch)); }

absl::StatusOr<Place> DecodePlace(const bufferlist& row) {
  const std::vector<std::string> parts = absl::StrSplit(row.to_str(), absl::MaxSplits(' ', 2));
  Place place;
  if (parts.size() != 3 || !absl::SimpleAtoi(parts[0], &place.offset) || !absl::SimpleAtoi(parts[1], &place.length)) {
    return absl::DataLossError("a row of a group's index is damaged");
  }
  place.batch = parts[2];
  return place;
}

absl::StatusOr<uint64_t> DecodeCount(const bufferlist& row) {
  uint64_t count = 0;
  if (!absl::SimpleAtoi(row.to_str(), &count)) return absl::DataLossError("a row of a group's index is damaged");
  return count;
}

/// Values that go into one object.
struct Batch {
  std::string group;
  std::string name;  ///< the same values give the same name, so that a second try leaves nothing behind
  bufferlist data;
  std::vector<std::pair<std::string, Place>> places;
};

/// The first key for people to read, and 64 bits of FNV-1a over all of them: values never change, so the same keys are
/// the same batch.
std::string NameOf(const Batch& batch) {
  uint64_t hash = 14695981039346656037U;
  const auto add = [&hash](unsigned char byte) { hash = (hash ^ byte) * 1099511628211U; };
  for (const auto& [key, place] : batch.places) {
    for (const char byte : key) add(static_cast<unsigned char>(byte));
    for (int shift = 0; shift < 64; shift += 8) add(static_cast<unsigned char>(place.length >> shift));
  }
  return Text(absl::CEscape(batch.places.front().first), ".", absl::Hex(hash, absl::kZeroPad16));
}

std::vector<Batch> BatchesOf(std::string_view group, std::span<const ImmutableValue> values) {
  std::vector<Batch> batches;
  for (const ImmutableValue& value : values) {
    if (batches.empty() || batches.back().data.length() + value.value.size() > kBatchBytes) {
      batches.push_back({.group = std::string(group)});
    }
    Batch& batch = batches.back();
    batch.places.push_back({value.key, {batch.data.length(), value.value.size(), ""}});
    batch.data.append(value.value);
  }
  for (Batch& batch : batches) {
    batch.name = NameOf(batch);
    for (auto& [key, place] : batch.places) place.batch = batch.name;
  }
  return batches;
}

using Completion = std::unique_ptr<librados::AioCompletion>;
Completion NewCompletion() { return Completion(librados::Rados::aio_create_completion()); }

/// Several values of one object, on their way.
struct ObjectRead {
  struct Part {
    size_t value = 0;  ///< which of those asked for
    Place place;
    bufferlist data;
  };
  std::vector<Part> parts;
  Completion done = NewCompletion();
  int code = 0;
};

class RadosEngine final : public Engine {
 public:
  RadosEngine(std::unique_ptr<librados::Rados> cluster, librados::IoCtx io)
      : cluster_(std::move(cluster)), io_(std::move(io)) {}
  ~RadosEngine() override {
    io_.close();
    cluster_->shutdown();
  }

  absl::StatusOr<std::optional<std::string>> Get(std::string_view partition, std::string_view key) const override {
    const absl::StatusOr<Rows> rows = GetRows(RowsObject(partition), {std::string(key)}, Describe("read", partition));
    if (!rows.ok()) return rows.status();
    if (rows->empty()) return std::nullopt;
    return ValueOfRow(rows->begin()->second);
  }

  absl::Status Scan(std::string_view partition, std::string_view begin, std::string_view end,
                    const std::function<bool(std::string_view, std::string_view)>& row) const override {
    return ScanObject(RowsObject(partition), begin, end, Describe("scan", partition),
                      [&row](const std::string& key, const bufferlist& value) { return row(key, ValueOfRow(value)); });
  }

  absl::Status Write(std::string_view partition, std::span<const Mutation> mutations, Durability) override {
    if (absl::Status status = CheckName(partition); !status.ok()) return status;
    librados::ObjectWriteOperation operation;
    operation.create(false);
    Add(mutations, operation);
    return Operate(RowsObject(partition), operation, Describe("write", partition));
  }

  absl::Status CompareAndSet(std::string_view partition, std::span<const Condition> conditions,
                             std::span<const Mutation> mutations) override {
    if (absl::Status status = CheckName(partition); !status.ok()) return status;
    librados::ObjectWriteOperation operation;
    operation.create(false);
    std::map<std::string, std::pair<bufferlist, int>> compared;
    for (const Condition& condition : conditions) {
      compared[condition.key] = {condition.value ? RowValue(*condition.value) : bufferlist(), LIBRADOS_CMPXATTR_OP_EQ};
    }
    int compare_result = 0;
    if (!compared.empty()) operation.omap_cmp(compared, &compare_result);
    Add(mutations, operation);
    const int code = io_.operate(RowsObject(partition), &operation, librados::OPERATION_FULL_TRY);
    if (code == -ECANCELED) return Differing(partition, conditions);
    return FromRados(code, Direction::kWrite, Describe("compare-and-set", partition));
  }

  absl::Status PutValues(std::string_view group, std::span<const ImmutableValue> values) override {
    const ValueGroup one{std::string(group), {values.begin(), values.end()}};
    return PutGroups({&one, 1});
  }

  /// All objects of values at once, then all indices at once.
  absl::Status PutGroups(std::span<const ValueGroup> groups) override {
    std::vector<Batch> batches;
    for (const ValueGroup& group : groups) {
      if (absl::Status status = CheckName(group.group); !status.ok()) return status;
      for (Batch& batch : BatchesOf(group.group, group.values)) batches.push_back(std::move(batch));
    }
    absl::Status status = ForEachBatch(batches, [this](const Batch& batch, librados::AioCompletion* done) {
      librados::ObjectWriteOperation operation;
      bufferlist data = batch.data;  // write_full takes what it is given
      operation.write_full(data);
      return io_.aio_operate(BatchObject(batch.group, batch.name), done, &operation, librados::OPERATION_FULL_TRY);
    });
    if (!status.ok()) return status;
    std::vector<int> codes;
    status = ForEachBatch(
        batches,
        [this](const Batch& batch, librados::AioCompletion* done) {
          librados::ObjectWriteOperation operation;
          Index(batch, operation);
          return io_.aio_operate(IndexObject(batch.group), done, &operation, librados::OPERATION_FULL_TRY);
        },
        &codes);
    if (!status.ok()) return status;
    for (size_t i = 0; i < batches.size(); ++i) {
      if (codes[i] != -ECANCELED) continue;
      if (status = PutMissing(batches[i]); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  absl::StatusOr<std::string> GetValue(std::string_view group, std::string_view key) const override {
    const std::string what =
        Text("read value ", absl::Utf8SafeCEscape(ToAbsl(group)), " ", absl::CHexEscape(ToAbsl(key)));
    const absl::StatusOr<Rows> rows = GetRows(IndexObject(group), {Text(kValue, key)}, what);
    if (!rows.ok()) return rows.status();
    if (rows->empty()) return absl::NotFoundError(what);
    const absl::StatusOr<Place> place = DecodePlace(rows->begin()->second);
    if (!place.ok()) return place.status();
    if (place->length == 0) return std::string();
    bufferlist data;
    librados::IoCtx io = io_;
    const int code = io.read(BatchObject(group, place->batch), data, place->length, place->offset);
    if (code < 0) return FromRados(code, Direction::kRead, what);
    if (data.length() != place->length) return absl::DataLossError(Text(what, ": its object is too short"));
    return data.to_str();
  }

  /// One look into the index, then one read an object, all at once.
  std::vector<absl::StatusOr<std::string>> GetValues(std::string_view group,
                                                     std::span<const std::string> keys) const override {
    const std::string what = Describe("read values", group);
    std::set<std::string> rows;
    for (const std::string& key : keys) rows.insert(Text(kValue, key));
    const absl::StatusOr<Rows> places = GetRows(IndexObject(group), rows, what);
    if (!places.ok()) return {keys.size(), absl::StatusOr<std::string>(places.status())};
    std::vector<absl::StatusOr<std::string>> values(keys.size(), absl::NotFoundError(what));
    std::map<std::string, ObjectRead> reads;
    for (size_t i = 0; i < keys.size(); ++i) {
      const auto row = places->find(Text(kValue, keys[i]));
      if (row == places->end()) continue;
      const absl::StatusOr<Place> place = DecodePlace(row->second);
      if (!place.ok()) {
        values[i] = place.status();
      } else if (place->length == 0) {
        values[i] = std::string();
      } else {
        reads[place->batch].parts.push_back({i, *place, {}});
      }
    }
    librados::IoCtx io = io_;
    for (auto& [batch, read] : reads) {
      librados::ObjectReadOperation operation;
      for (ObjectRead::Part& part : read.parts) {
        operation.read(part.place.offset, part.place.length, &part.data, nullptr);
      }
      read.code = io.aio_operate(BatchObject(group, batch), read.done.get(), &operation, nullptr);
    }
    for (auto& [batch, read] : reads) {
      if (read.code >= 0) {
        read.done->wait_for_complete();
        read.code = read.done->get_return_value();
      }
      for (const ObjectRead::Part& part : read.parts) {
        if (read.code < 0) {
          values[part.value] = FromRados(read.code, Direction::kRead, what);
        } else if (part.data.length() != part.place.length) {
          values[part.value] = absl::DataLossError(Text(what, ": an object is too short"));
        } else {
          values[part.value] = part.data.to_str();
        }
      }
    }
    return values;
  }

  absl::Status DeleteValues(std::string_view group, std::span<const std::string> keys) override {
    if (absl::Status status = CheckName(group); !status.ok()) return status;
    std::set<std::string> wanted;
    for (const std::string& key : keys) wanted.insert(Text(kValue, key));
    absl::Status last;
    for (int i = 0; i < kTries && !wanted.empty(); ++i) {
      last = DeleteOnce(group, wanted);
      if (!absl::IsAborted(last)) return last;  // aborted: somebody else deleted of the same batch
    }
    return last;
  }

  absl::Status ScanValueKeys(std::string_view group, std::string_view begin, std::string_view end,
                             const std::function<bool(std::string_view)>& row) const override {
    std::string after(kValue);
    after.back() = static_cast<char>(after.back() + 1);
    return ScanObject(IndexObject(group), Text(kValue, begin), end.empty() ? after : Text(kValue, end),
                      Describe("scan values", group), [&row](const std::string& key, const bufferlist&) {
                        return row(std::string_view(key).substr(kValue.size()));
                      });
  }

  absl::Status Sync() override { return absl::OkStatus(); }

  absl::Status Checkpoint(const std::string&) override {
    return absl::UnimplementedError("a RADOS pool has no checkpoint: back up a map as of one epoch");
  }

 private:
  using RowVisitor = std::function<bool(const std::string& key, const bufferlist& value)>;

  static void Add(std::span<const Mutation> mutations, librados::ObjectWriteOperation& operation) {
    Rows written;
    std::set<std::string> deleted;
    for (const Mutation& mutation : mutations) {  // the last one of a key counts
      if (mutation.value) {
        written[mutation.key] = RowValue(*mutation.value);
        deleted.erase(mutation.key);
      } else {
        written.erase(mutation.key);
        deleted.insert(mutation.key);
      }
    }
    if (!written.empty()) operation.omap_set(written);
    if (!deleted.empty()) operation.omap_rm_keys(deleted);
  }

  absl::Status Operate(const std::string& object, librados::ObjectWriteOperation& operation, std::string_view what) {
    return FromRados(io_.operate(object, &operation, librados::OPERATION_FULL_TRY), Direction::kWrite, what);
  }

  absl::StatusOr<Rows> GetRows(const std::string& object, const std::set<std::string>& keys,
                               std::string_view what) const {
    Rows rows;
    librados::IoCtx io = io_;
    const int code = io.omap_get_vals_by_keys(object, keys, &rows);
    if (code < 0 && code != -ENOENT) return FromRados(code, Direction::kRead, what);
    return rows;
  }

  absl::Status ScanObject(const std::string& object, std::string_view begin, std::string_view end,
                          std::string_view what, const RowVisitor& row) const {
    // Reads go on after a key; the first one is looked up by itself.
    const std::string first(begin);
    if (!first.empty()) {
      const absl::StatusOr<Rows> found = GetRows(object, {first}, what);
      if (!found.ok()) return found.status();
      if (!found->empty() && (end.empty() || first < end) && !row(first, found->begin()->second)) {
        return absl::OkStatus();
      }
    }
    librados::IoCtx io = io_;
    std::string after = first;
    while (true) {
      Rows rows;
      bool more = false;
      const int code = io.omap_get_vals2(object, after, kRowsAtOnce, &rows, &more);
      if (code == -ENOENT) return absl::OkStatus();
      if (code < 0) return FromRados(code, Direction::kRead, what);
      for (const auto& [key, value] : rows) {
        if (!end.empty() && key >= end) return absl::OkStatus();
        if (!row(key, value)) return absl::OkStatus();
      }
      if (rows.empty() || !more) return absl::OkStatus();
      after = rows.rbegin()->first;
    }
  }

  /// Why a compare-and-set was refused: RADOS does not say which row differed.
  absl::Status Differing(std::string_view partition, std::span<const Condition> conditions) const {
    for (const Condition& condition : conditions) {
      const absl::StatusOr<std::optional<std::string>> found = Get(partition, condition.key);
      if (!found.ok() || *found == condition.value) continue;
      const char* difference = !condition.value ? "exists" : *found ? "has changed" : "is absent";
      return absl::AbortedError(Text("row ", absl::Utf8SafeCEscape(condition.key), " of ",
                                     absl::Utf8SafeCEscape(ToAbsl(partition)), " ", difference));
    }
    return absl::AbortedError(Describe("another row, for a moment, of", partition));
  }

  /// Starts an operation a batch and waits for all. A code of ECANCELED is left to the caller, if it asks for codes.
  template <typename Start>
  absl::Status ForEachBatch(const std::vector<Batch>& batches, const Start& start, std::vector<int>* codes = nullptr) {
    std::vector<Completion> started;
    for (const Batch& batch : batches) {
      started.push_back(NewCompletion());
      const int code = start(batch, started.back().get());
      if (code < 0) {
        started.pop_back();
        for (const Completion& one : started) one->wait_for_complete();
        return FromRados(code, Direction::kWrite, Describe("write values", batch.group));
      }
    }
    absl::Status first;
    for (size_t i = 0; i < started.size(); ++i) {
      started[i]->wait_for_complete();
      const int code = started[i]->get_return_value();
      if (codes != nullptr) codes->push_back(code);
      if (codes != nullptr && code == -ECANCELED) continue;
      if (first.ok()) first = FromRados(code, Direction::kWrite, Describe("write values", batches[i].group));
    }
    return first;
  }

  /// Makes a batch known, if none of its values is yet.
  static void Index(const Batch& batch, librados::ObjectWriteOperation& operation) {
    operation.create(false);
    std::map<std::string, std::pair<bufferlist, int>> absent;
    Rows rows;
    for (const auto& [key, place] : batch.places) {
      absent[Text(kValue, key)] = {bufferlist(), LIBRADOS_CMPXATTR_OP_EQ};
      rows[Text(kValue, key)] = Encode(place);
    }
    rows[Text(kBatch, batch.name)] = BufferOf(Text(batch.places.size()));
    operation.omap_cmp(absent, nullptr);
    operation.omap_set(rows);
  }

  /// Of a batch some of whose values are there already: writes the others. Values never change, so what is there is
  /// right.
  absl::Status PutMissing(const Batch& batch) {
    std::set<std::string> keys;
    for (const auto& [key, place] : batch.places) keys.insert(Text(kValue, key));
    const absl::StatusOr<Rows> found = GetRows(IndexObject(batch.group), keys, Describe("write values", batch.group));
    if (!found.ok()) return found.status();
    std::vector<ImmutableValue> missing;
    bool in_use = false;  // an earlier try of this batch made it known
    for (const auto& [key, place] : batch.places) {
      const auto row = found->find(Text(kValue, key));
      if (row == found->end()) {
        bufferlist value;
        value.substr_of(batch.data, place.offset, place.length);
        missing.push_back({key, value.to_str()});
        continue;
      }
      const absl::StatusOr<Place> known = DecodePlace(row->second);
      if (!known.ok()) return known.status();
      in_use |= known->batch == batch.name;
    }
    if (!in_use) io_.remove(BatchObject(batch.group, batch.name));
    return missing.empty() ? absl::OkStatus() : PutValues(batch.group, missing);
  }

  /// Takes what is there of `wanted` out of its batches. ABORTED if a batch changed meanwhile.
  absl::Status DeleteOnce(std::string_view group, const std::set<std::string>& wanted) {
    const std::string what = Describe("delete values", group);
    const absl::StatusOr<Rows> found = GetRows(IndexObject(group), wanted, what);
    if (!found.ok()) return found.status();
    std::map<std::string, std::set<std::string>> by_batch;
    std::set<std::string> counts;
    for (const auto& [key, row] : *found) {
      const absl::StatusOr<Place> place = DecodePlace(row);
      if (!place.ok()) return place.status();
      by_batch[place->batch].insert(key);
      counts.insert(Text(kBatch, place->batch));
    }
    if (by_batch.empty()) return absl::OkStatus();
    const absl::StatusOr<Rows> left = GetRows(IndexObject(group), counts, what);
    if (!left.ok()) return left.status();
    librados::ObjectWriteOperation operation;
    std::map<std::string, std::pair<bufferlist, int>> unchanged;
    Rows lowered;
    std::set<std::string> gone;
    for (const auto& [batch, keys] : by_batch) {
      const std::string row = Text(kBatch, batch);
      const auto count_row = left->find(row);
      if (count_row == left->end()) return absl::AbortedError(what);
      const absl::StatusOr<uint64_t> count = DecodeCount(count_row->second);
      if (!count.ok()) return count.status();
      unchanged[row] = {count_row->second, LIBRADOS_CMPXATTR_OP_EQ};
      gone.insert(keys.begin(), keys.end());
      if (*count > keys.size()) {
        lowered[row] = BufferOf(Text(*count - keys.size()));
        continue;
      }
      // The object first: what the index still names then is not there, as it is meant to be, and is deleted again.
      gone.insert(row);
      const int code = io_.remove(BatchObject(group, batch));
      if (code < 0 && code != -ENOENT) return FromRados(code, Direction::kWrite, what);
    }
    operation.omap_cmp(unchanged, nullptr);
    if (!lowered.empty()) operation.omap_set(lowered);
    operation.omap_rm_keys(gone);
    const int code = io_.operate(IndexObject(group), &operation, librados::OPERATION_FULL_TRY);
    if (code == -ECANCELED) return absl::AbortedError(what);
    return FromRados(code, Direction::kWrite, what);
  }

  const std::unique_ptr<librados::Rados> cluster_;
  librados::IoCtx io_;
};

absl::Status Configure(librados::Rados& cluster, const RadosOptions& options) {
  const int read = cluster.conf_read_file(options.conf.empty() ? nullptr : options.conf.c_str());
  if (read < 0)
    return FromRados(read, Direction::kRead, Text("read ", options.conf.empty() ? "ceph.conf" : options.conf));
  std::vector<std::pair<std::string, std::string>> settings = {{"rados_osd_op_timeout", Text(options.timeout_seconds)},
                                                               {"rados_mon_op_timeout", Text(options.timeout_seconds)},
                                                               {"client_mount_timeout", Text(options.timeout_seconds)}};
  if (!options.keyring.empty()) settings.emplace_back("keyring", options.keyring);
  for (const auto& [name, value] : settings) {
    const int set = cluster.conf_set(name.c_str(), value.c_str());
    if (set < 0) return FromRados(set, Direction::kRead, Text("set ", name));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<Engine>> OpenRadosEngine(const RadosOptions& options) {
  auto cluster = std::make_unique<librados::Rados>();
  if (const int made = cluster->init(options.user.c_str()); made < 0) {
    return FromRados(made, Direction::kRead, Text("RADOS client.", options.user));
  }
  if (absl::Status status = Configure(*cluster, options); !status.ok()) return status;
  const int connected = cluster->connect();
  if (connected < 0) {
    return FromRados(connected, Direction::kRead, Text("connect to the RADOS cluster as client.", options.user));
  }
  librados::IoCtx io;
  if (const int opened = cluster->ioctx_create(options.pool.c_str(), io); opened < 0) {
    cluster->shutdown();
    return FromRados(opened, Direction::kRead, Text("open RADOS pool ", options.pool));
  }
  io.set_namespace(options.name_space);
  return std::make_unique<RadosEngine>(std::move(cluster), std::move(io));
}

}  // namespace mapkeep
