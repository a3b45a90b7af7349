#pragma once

// gRPC's headers take seconds to compile; the few files of this folder that need them share this precompiled header.
#include <grpcpp/grpcpp.h>

#include "mapkeep/v1/map_service.grpc.pb.h"
#include "mapkeep/v1/session_service.grpc.pb.h"
#include "mapkeep/v1/tile_service.grpc.pb.h"
