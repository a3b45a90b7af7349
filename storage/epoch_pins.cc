#include "storage/epoch_pins.h"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr int kTries = 16;
constexpr uint64_t kUnpinned = UINT64_MAX;  ///< generation of holds that have no pin

}  // namespace

EpochPins::EpochPins(Engine& engine, Clock now, double seconds)
    : engine_(engine), now_(std::move(now)), seconds_(seconds), key_(PinRowKey(Random64())) {
  renewer_ = std::thread([this] { RenewAll(); });
}

EpochPins::~EpochPins() {
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
  }
  stop_signal_.notify_all();
  renewer_.join();
  for (const auto& [incarnation, reader] : readers_) {
    if (!reader->row) continue;
    // Left behind, it only lasts until its lease ends.
    const std::vector<Mutation> gone = {{key_, std::nullopt}};
    engine_.Write(HeadPartition(incarnation), gone, Durability::kBuffered).IgnoreError();
  }
}

EpochPins::Reader& EpochPins::ReaderOf(uint64_t incarnation) {
  const std::scoped_lock lock(mutex_);
  std::unique_ptr<Reader>& reader = readers_[incarnation];
  if (reader == nullptr) reader = std::make_unique<Reader>();
  return *reader;
}

absl::StatusOr<std::unique_ptr<EpochPins::Hold>> EpochPins::Pin(uint64_t incarnation, uint64_t epoch) {
  Reader& reader = ReaderOf(incarnation);
  const std::scoped_lock lock(reader.mutex);
  if (!Covers(reader, epoch) || now_() + seconds_ / 4 >= reader.row->value.expires) {
    const absl::Status placed = Place(incarnation, reader, epoch);
    if (absl::IsResourceExhausted(placed)) return std::make_unique<Hold>(*this, incarnation, epoch, kUnpinned);
    if (!placed.ok()) return placed;
  }
  reader.open.insert(epoch);
  return std::make_unique<Hold>(*this, incarnation, epoch, reader.generation);
}

bool EpochPins::Covers(const Reader& reader, uint64_t epoch) {
  return reader.row && (epoch >= reader.covers_from || reader.open.contains(epoch));
}

absl::Status EpochPins::Place(uint64_t incarnation, Reader& reader, uint64_t epoch) {
  const std::string partition = HeadPartition(incarnation);
  for (int i = 0; i < kTries; ++i) {
    const auto row = ReadRow(engine_, partition, key_, DecodePin);
    if (!row.ok()) return row.status();
    if (!reader.row || !*row || (*row)->bytes != reader.row->bytes) reader.covers_from = UINT64_MAX;
    if (reader.row && (!*row || (*row)->bytes != reader.row->bytes)) {
      // It expired and was collected, or a write of unknown outcome came through: begin again.
      ++reader.generation;
      reader.open.clear();
    }
    reader.row = *row;
    absl::Status placed = PlaceAnew(incarnation, reader, epoch);
    if (!absl::IsAborted(placed)) return placed;
  }
  return absl::UnavailableError(Text("epoch ", epoch, " could not be pinned: its map changes too often"));
}

absl::Status EpochPins::PlaceAnew(uint64_t incarnation, Reader& reader, uint64_t epoch) {
  const std::string partition = HeadPartition(incarnation);
  const absl::StatusOr<std::optional<std::string>> map = engine_.Get(partition, kMapRow);
  if (!map.ok()) return map.status();
  if (!*map) return absl::NotFoundError("the map is deleted");
  const auto oldest = ReadRow(engine_, partition, kOldestRow, DecodeNumber);
  if (!oldest.ok()) return oldest.status();
  const bool covered = Covers(reader, epoch);
  const uint64_t lowest = *oldest ? (*oldest)->value : 0;
  absl::StatusOr<std::optional<StoredRow<Tags>>> tags = std::optional<StoredRow<Tags>>();
  if (!covered && epoch < lowest) {
    tags = ReadRow(engine_, partition, kTagsRow, DecodeTags);
    if (!tags.ok()) return tags.status();
    if (!*tags || !IsTagged((*tags)->value, epoch)) {
      return absl::FailedPreconditionError(Text("epoch ", epoch, " is collected: the oldest one kept is ", lowest));
    }
  }
  mapkeep::Pin pin{epoch, now_() + seconds_};
  if (!reader.open.empty()) pin.epoch = std::min(pin.epoch, *reader.open.begin());
  StoredRow<mapkeep::Pin> next{EncodeRow(pin), pin};
  std::vector<Condition> conditions = {
      {std::string(kMapRow), *map},
      {key_, reader.row ? std::optional(reader.row->bytes) : std::nullopt},
  };
  if (!covered) {
    conditions.push_back({std::string(kOldestRow), BytesOf(*oldest)});
    if (*tags) conditions.push_back({std::string(kTagsRow), BytesOf(*tags)});
  }
  const std::vector<Mutation> mutations = {{key_, next.bytes}};
  absl::Status written = engine_.CompareAndSet(partition, conditions, mutations);
  if (written.ok()) {
    // What the row keeps from now on, as far as it was not collected before: what it kept already is not, nor is what
    // the oldest epoch that the row required still lets in.
    const uint64_t whole_from = covered ? reader.covers_from : std::min(reader.covers_from, lowest);
    reader.covers_from = std::max(pin.epoch, whole_from);
    reader.row = std::move(next);
  }
  return written;
}

absl::Status EpochPins::Renew(uint64_t incarnation, Reader& reader) {
  const std::scoped_lock lock(reader.mutex);
  if (!reader.row) return absl::OkStatus();
  if (!reader.open.empty()) return Place(incarnation, reader, *reader.open.begin());
  const std::vector<Condition> conditions = {{key_, reader.row->bytes}};
  const std::vector<Mutation> mutations = {{key_, std::nullopt}};
  reader.row.reset();
  return engine_.CompareAndSet(HeadPartition(incarnation), conditions, mutations);
}

void EpochPins::RenewAll() {
  const auto pause = std::chrono::duration_cast<std::chrono::system_clock::duration>(
      std::chrono::duration<double>(std::clamp(seconds_ / 3, 0.01, 3600.0)));
  std::unique_lock lock(mutex_);
  while (!stop_signal_.wait_until(lock, std::chrono::system_clock::now() + pause, [this] { return stop_; })) {
    std::vector<std::pair<uint64_t, Reader*>> readers;
    for (const auto& [incarnation, reader] : readers_) readers.emplace_back(incarnation, reader.get());
    lock.unlock();
    // A failure shows when the pin is next needed: a hold that no longer stands, or an epoch that cannot be opened.
    for (const auto& [incarnation, reader] : readers) Renew(incarnation, *reader).IgnoreError();
    lock.lock();
  }
}

void EpochPins::Release(const Hold& hold) {
  Reader& reader = ReaderOf(hold.incarnation_);
  const std::scoped_lock lock(reader.mutex);
  if (hold.generation_ == reader.generation) reader.open.erase(reader.open.find(hold.epoch_));
}

bool EpochPins::Stands(const Hold& hold) {
  Reader& reader = ReaderOf(hold.incarnation_);
  const std::scoped_lock lock(reader.mutex);
  if (hold.generation_ != reader.generation || !reader.row) return false;
  const absl::StatusOr<std::optional<std::string>> row = engine_.Get(HeadPartition(hold.incarnation_), key_);
  return row.ok() && *row == reader.row->bytes;
}

}  // namespace mapkeep
