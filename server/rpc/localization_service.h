#pragma once

#include "mapkeep/v1/localization_service.grpc.pb.h"
#include "server/rpc/context.h"

namespace mapkeep {

/// Finds where a few scans were taken in a map; see localization_service.proto.
class LocalizationService final : public v1::LocalizationService::CallbackService {
 public:
  explicit LocalizationService(const ServiceContext& context) : context_(context) {}

  grpc::ServerReadReactor<v1::LocalizeRequest>* Localize(grpc::CallbackServerContext* call,
                                                         v1::LocalizeResponse* response) override;

 private:
  const ServiceContext context_;
};

}  // namespace mapkeep
