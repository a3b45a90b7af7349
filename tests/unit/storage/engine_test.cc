#include "tests/unit/storage/engine_conformance.h"

namespace mapkeep {
namespace {

INSTANTIATE_TEST_SUITE_P(Engines, EngineTest, testing::Values(RocksDbKind()),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace mapkeep
