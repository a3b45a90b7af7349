#include <absl/container/flat_hash_set.h>

#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "storage/commit_plan.h"
#include "storage/map_history.h"
#include "storage/map_store_state.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr int kMaxRounds = 256;  ///< of one commit: each lost race is somebody else's commit
constexpr int kTries = 10;       ///< to learn what became of an operation
constexpr auto kFirstPause = std::chrono::milliseconds(5);

/// Whether the operation may have been applied, or may still be.
bool IsOpen(const absl::Status& status) { return absl::IsUnknown(status) || absl::IsDeadlineExceeded(status); }

/// One call of MapStore::Commit: steps 0 to 4 of the commit protocol.
class Committer {
 public:
  Committer(MapStore::State& store, std::string_view map, const CommitRequest& request, uint64_t incarnation)
      : store_(store),
        map_(map),
        request_(request),
        incarnation_(incarnation),
        partition_(HeadPartition(incarnation)) {}

  absl::StatusOr<CommitRecord> Run() {
    for (int i = 0; i < kMaxRounds; ++i) {
      absl::StatusOr<std::optional<CommitRecord>> made = Round();
      if (!made.ok()) {
        if (!IsOpen(made.status())) Abandon();
        return made.status();
      }
      if (*made) return **std::move(made);
    }
    Abandon();
    return absl::UnavailableError(
        Text("session ", request_.session, ": other commits came first ", kMaxRounds, " times"));
  }

 private:
  /// One attempt on one head: the record, or nothing if another commit came first.
  absl::StatusOr<std::optional<CommitRecord>> Round() {
    absl::StatusOr<std::unique_ptr<const Snapshot::State>> opened = OpenState(store_, map_, std::nullopt);
    if (absl::IsNotFound(opened.status())) return absl::AbortedError(Text("map ", map_, " was deleted"));
    if (!opened.ok()) return opened.status();
    const Snapshot::State& base = **opened;
    if (base.map.incarnation != incarnation_) {
      return absl::AbortedError(Text("map ", map_, " was deleted and made again"));
    }
    absl::StatusOr<std::optional<CommitRecord>> applied = FindCommitIn(store_.engine, incarnation_, request_.session);
    if (!applied.ok()) return applied.status();
    if (*applied) {
      Abandon();
      return applied;
    }
    if (absl::Status status = CheckFence(); !status.ok()) return status;
    EpochState next = base.at;
    if (absl::Status status = CheckBase(next); !status.ok()) return status;
    if (request_.origin) next.origin = request_.origin;

    const EpochState at = base.at;
    const std::string head = base.row;
    const MapValues values = base.values;
    const Snapshot snapshot(*std::move(opened));
    absl::StatusOr<std::vector<Block>> blocks = request_.blocks(snapshot);
    if (!blocks.ok()) return blocks.status();
    const WriteId id{intent_.attempt, round_++};
    absl::StatusOr<CommitPlan> plan = PlanCommit(values, at.root, *std::move(blocks), earlier_, id);
    if (!plan.ok()) return plan.status();

    absl::StatusOr<bool> announced = Announce(*plan, id);
    if (!announced.ok()) return announced.status();
    if (!*announced) return std::nullopt;
    if (absl::Status status = PutValues(*plan); !status.ok()) return status;
    for (const auto& [key, written] : plan->blocks) earlier_.insert_or_assign(key, written);
    ++next.epoch;
    ++next.sessions;
    next.root = plan->edit.root;
    const CommitRecord record{next.epoch,           request_.session,
                              request_.base_epoch,  AttemptName(request_.session, intent_.attempt),
                              store_.options.now(), plan->touched_tiles};
    const absl::StatusOr<bool> swapped = SwapHead(head, next, record, *plan);
    if (!swapped.ok()) return swapped.status();
    if (!*swapped) return std::nullopt;
    for (const auto& [name, node] : plan->edit.written) values.Remember(name, node);
    for (const auto& [key, written] : plan->blocks) {
      values.Remember({ValueKind::kBlock, static_cast<uint64_t>(key), written.entry.written}, written.block);
    }
    return record;
  }

  Condition FenceCondition() const {
    Condition condition{SessionFenceRow(request_.session), std::nullopt};
    if (request_.lease_fence != 0) condition.value = EncodeRow(request_.lease_fence);
    return condition;
  }

  absl::Status CheckFence() const {
    const Condition wanted = FenceCondition();
    const absl::StatusOr<std::optional<std::string>> fence = store_.engine.Get(partition_, wanted.key);
    if (!fence.ok()) return fence.status();
    if (*fence == wanted.value) return absl::OkStatus();
    return absl::AbortedError(
        Text("session ", request_.session, ": its lease (fence ", request_.lease_fence, ") has moved on"));
  }

  /// A session's blocks lie in the frame that the map had at its base epoch; a first session that chose an origin
  /// meanwhile moved that frame.
  absl::Status CheckBase(const EpochState& head) const {
    const absl::StatusOr<bool> ancestor = IsAncestor(store_.engine, incarnation_, request_.base_epoch, head);
    if (!ancestor.ok()) return ancestor.status();
    if (!*ancestor) {
      return absl::AbortedError(Text("epoch ", request_.base_epoch, ", which session ", request_.session,
                                     " was aligned to, was rolled back"));
    }
    if (request_.origin && head.epoch == 0 && head.origin.value_or(*request_.origin) == *request_.origin) {
      return absl::OkStatus();
    }
    std::optional<Eigen::Vector3d> expected = request_.origin;
    if (!expected && request_.base_epoch != head.epoch) {
      const auto base = ReadRow(store_.engine, partition_, RootRow(request_.base_epoch), DecodeEpoch);
      if (!base.ok()) return base.status();
      expected = *base ? (*base)->value.origin : head.origin;
    } else if (!expected) {
      return absl::OkStatus();
    }
    if (expected == head.origin) return absl::OkStatus();
    return absl::AbortedError(Text("map ", map_, " took another origin since epoch ", request_.base_epoch,
                                   ", which session ", request_.session, " was aligned to"));
  }

  /// Step 0: makes known who writes which values, before they are written, so that they are found again if this
  /// process dies. False if the collector ended the attempt, and a new one has to begin. Only an intent known to be
  /// there is ever required of the head's compare-and-set.
  absl::StatusOr<bool> Announce(const CommitPlan& plan, const WriteId& id) {
    const Staged staged{request_.session, id.attempt, plan.names};
    absl::Status last;
    for (int i = 0; i < kTries; ++i) {
      Pause(i);
      const absl::StatusOr<std::optional<std::string>> alive = store_.engine.Get(partition_, kMapRow);
      if (!alive.ok()) return alive.status();
      if (!*alive) return absl::AbortedError(Text("map ", map_, " was deleted"));
      Intent next = intent_;
      next.session = request_.session;
      next.fence = request_.lease_fence;
      next.nonce = Random64();
      next.expires = store_.options.now() + store_.options.intent_seconds;
      const std::string bytes = EncodeRow(next);
      const std::vector<Condition> conditions = {{std::string(kMapRow), *alive},
                                                 {IntentRowKey(intent_.attempt), intent_row_}};
      const std::vector<Mutation> mutations = {{IntentRowKey(intent_.attempt), bytes},
                                               {StagedRowKey(id), EncodeRow(staged)}};
      // It is to be found only if the values are, which are written after it.
      last = store_.engine.CompareAndSetBuffered(partition_, conditions, mutations);
      if (last.ok()) {
        intent_ = next;
        intent_row_ = bytes;
        staged_.push_back(StagedRowKey(id));
        names_.insert(names_.end(), plan.names.begin(), plan.names.end());
        return true;
      }
      if (!absl::IsAborted(last) && !IsOpen(last)) return last;
      const auto found = store_.engine.Get(partition_, IntentRowKey(intent_.attempt));
      if (!found.ok()) return found.status();
      if (!*found && intent_row_) {
        BeginAgain();
        return false;
      }
      intent_row_ = *found;
    }
    return last;
  }

  /// Step 2. The same values again do no harm.
  absl::Status PutValues(const CommitPlan& plan) {
    absl::Status status = absl::UnknownError("");
    for (int i = 0; i < kTries && IsOpen(status); ++i) {
      Pause(i);
      status = store_.engine.PutGroups(plan.groups);
    }
    return status;
  }

  /// Step 3. False if the race was lost, or the attempt was ended by the collector.
  absl::StatusOr<bool> SwapHead(const std::string& head, const EpochState& next, const CommitRecord& record,
                                const CommitPlan& plan) {
    const std::vector<Condition> conditions = {{std::string(kHeadRow), head},
                                               {IntentRowKey(intent_.attempt), intent_row_},
                                               FenceCondition(),
                                               {AppliedRowKey(request_.session), std::nullopt}};
    const std::string row = EncodeRow(next);
    std::vector<Mutation> mutations = {
        {std::string(kHeadRow), row},
        {RootRow(next.epoch), row},
        {CommitRowKey(next.epoch), EncodeRow(record)},
        {AppliedRowKey(request_.session), EncodeRow(Applied{next.epoch, intent_.attempt})},
        {IntentRowKey(intent_.attempt), std::nullopt}};
    for (const std::string& staged : staged_) mutations.push_back({staged, std::nullopt});
    if (const Superseded superseded{SupersededBy(plan)}; !superseded.names.empty()) {
      mutations.push_back({SupersededRow(next.epoch), EncodeRow(superseded)});
    }
    const absl::Status swapped = store_.engine.CompareAndSet(partition_, conditions, mutations);
    if (swapped.ok()) {
      Forget();
      return true;
    }
    if (absl::IsAborted(swapped)) {
      const auto intent = store_.engine.Get(partition_, IntentRowKey(intent_.attempt));
      if (!intent.ok()) return intent.status();
      return *intent ? false : WithoutIntent();
    }
    if (!IsOpen(swapped)) return swapped;
    return FindOut(swapped);
  }

  /// Step 4: once a change of the intent is known to have gone through, the head's compare-and-set, which requires the
  /// intent as it was, can never be applied; if the intent is gone, it either was or never will be.
  absl::StatusOr<bool> FindOut(const absl::Status& unknown) {
    for (int i = 0; i < kTries; ++i) {
      Pause(i);
      Intent changed = intent_;
      changed.nonce = Random64();
      const std::string bytes = EncodeRow(changed);
      const std::vector<Condition> conditions = {{IntentRowKey(intent_.attempt), intent_row_}};
      const std::vector<Mutation> mutations = {{IntentRowKey(intent_.attempt), bytes}};
      const absl::Status fenced = store_.engine.CompareAndSet(partition_, conditions, mutations);
      if (fenced.ok()) {
        intent_row_ = bytes;
        return false;
      }
      if (!absl::IsAborted(fenced)) continue;
      const absl::StatusOr<std::optional<std::string>> found =
          store_.engine.Get(partition_, IntentRowKey(intent_.attempt));
      if (!found.ok()) continue;
      if (*found) {
        // A change that went unanswered came through. It must be changed once more, with an answer: until then another
        // unanswered one may be on its way.
        intent_row_ = **found;
        continue;
      }
      absl::StatusOr<bool> ours = WithoutIntent();
      if (ours.ok()) return ours;
    }
    return unknown;
  }

  /// Whether this attempt is applied, now that its intent is gone; if not, it never will be.
  absl::StatusOr<bool> WithoutIntent() {
    const auto applied = ReadRow(store_.engine, partition_, AppliedRowKey(request_.session), DecodeApplied);
    if (!applied.ok()) return applied.status();
    const bool ours = *applied && (*applied)->value.attempt == intent_.attempt;
    if (ours) {
      Forget();
    } else {
      BeginAgain();
    }
    return ours;
  }

  /// Values that no epoch from the new one on reaches: the old tree's, and what earlier rounds wrote in vain.
  std::vector<ValueName> SupersededBy(const CommitPlan& plan) const {
    std::vector<ValueName> names = plan.edit.superseded;
    absl::flat_hash_set<ValueName> used(plan.names.begin(), plan.names.end());
    for (const auto& [key, written] : plan.blocks) {
      used.insert({ValueKind::kBlock, static_cast<uint64_t>(key), written.entry.written});
    }
    for (const ValueName& name : names_) {
      if (!used.contains(name)) names.push_back(name);
    }
    return names;
  }

  /// Takes back the announcement, then what was written. Whatever fails here is left to the collector.
  void Abandon() {
    if (!intent_row_) return;
    const std::vector<Condition> conditions = {{IntentRowKey(intent_.attempt), intent_row_}};
    const std::vector<Mutation> mutations = {{IntentRowKey(intent_.attempt), std::nullopt}};
    if (!store_.engine.CompareAndSet(partition_, conditions, mutations).ok()) return;
    DropValues();
  }

  /// The collector ended this attempt: another one, from nothing. It deleted what it saw; the rest is deleted here.
  void BeginAgain() {
    DropValues();
    intent_.attempt = Random64();
  }

  /// Only once the intent is known to be gone and the attempt not applied.
  void DropValues() {
    std::vector<Mutation> rows;
    for (const std::string& staged : staged_) rows.push_back({staged, std::nullopt});
    if (DeleteNamed(store_.engine, incarnation_, names_).ok()) {
      store_.engine.Write(partition_, rows, Durability::kBuffered).IgnoreError();
    }
    Forget();
  }

  void Forget() {
    intent_row_.reset();
    staged_.clear();
    names_.clear();
    earlier_.clear();
    round_ = 0;
  }

  static void Pause(int tries) {
    if (tries > 0) std::this_thread::sleep_for(kFirstPause * (1 << std::min(tries, 7)));
  }

  MapStore::State& store_;
  const std::string_view map_;
  const CommitRequest& request_;
  const uint64_t incarnation_;
  const std::string partition_;
  Intent intent_{.attempt = Random64()};
  std::optional<std::string> intent_row_;  ///< as it lies in the engine; nothing before it is announced
  uint32_t round_ = 0;
  std::vector<std::string> staged_;  ///< rows announcing values
  std::vector<ValueName> names_;     ///< the values announced
  absl::flat_hash_map<BlockKey, WrittenBlock> earlier_;
};

}  // namespace

absl::StatusOr<CommitRecord> CommitTo(MapStore::State& store, std::string_view map, const CommitRequest& request) {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(store.engine, map);
  if (!incarnation.ok()) return incarnation.status();
  return Committer(store, map, request, *incarnation).Run();
}

absl::StatusOr<std::optional<CommitRecord>> FindCommitIn(const Engine& engine, uint64_t incarnation,
                                                         std::string_view session) {
  const auto applied = ReadRow(engine, HeadPartition(incarnation), AppliedRowKey(session), DecodeApplied);
  if (!applied.ok()) return applied.status();
  if (!*applied) return std::nullopt;
  absl::StatusOr<CommitRecord> commit = ReadCommit(engine, incarnation, (*applied)->value.epoch);
  if (!commit.ok()) return commit.status();
  return std::optional(*std::move(commit));
}

}  // namespace mapkeep
