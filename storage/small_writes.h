#pragma once

#include <rocksdb/env.h>

#include <memory>

namespace mapkeep {

/// `env` but for the files that are written through it: they are written in small pieces. A kernel that does not
/// interrupt itself gives the processor to nobody during one call, and a scan written whole takes it for milliseconds,
/// however little its thread has to say. `env` outlives it.
std::unique_ptr<rocksdb::Env> WithSmallWrites(rocksdb::Env& env);

}  // namespace mapkeep
