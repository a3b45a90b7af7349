#include <CLI/CLI.hpp>
#include <fstream>
#include <string>

#include "client/cli/command_line.h"

namespace mapkeep {
namespace {

constexpr char kGroup[] = "Connection";

// The first word of a file.
std::string TokenIn(const std::string& file) {
  std::ifstream in(file);
  std::string token;
  if (!in) throw CLI::ValidationError("--token-file", file + ": cannot be read");  // CLI11's way to refuse a value
  if (!(in >> token)) throw CLI::ValidationError("--token-file", file + ": is empty");
  return token;
}

}  // namespace

void AddConnectionOptions(CommandLine& line) {
  CLI::App& app = line.app;
  ClientOptions& client = line.options.client;
  app.add_option("--server", client.server, "Address of mapkeepd")
      ->type_name("HOST:PORT")
      ->envname("MAPKEEP_SERVER")
      ->capture_default_str()
      ->group(kGroup);
  app.add_flag("--tls", client.tls, "TLS with the system's certificate authorities")->group(kGroup);
  app.add_option("--tls-ca", client.tls_ca, "PEM: authorities of the server's certificate; implies --tls")
      ->type_name("FILE")
      ->group(kGroup);
  app.add_option("--tls-cert", client.tls_cert, "PEM: this client's certificate, if the server asks for one")
      ->type_name("FILE")
      ->group(kGroup);
  app.add_option("--tls-key", client.tls_key, "PEM: its private key")->type_name("FILE")->group(kGroup);
  app.add_option("--token", client.token, "Token of this robot or person; the environment hides it better")
      ->type_name("TOKEN")
      ->envname("MAPKEEP_TOKEN")
      ->group(kGroup);
  app.add_option_function<std::string>(
         "--token-file", [&client](const std::string& file) { client.token = TokenIn(file); },
         "File with the token; wins over --token")
      ->type_name("FILE")
      ->group(kGroup);
  app.add_flag("--insecure", client.insecure, "Send the token also without TLS to another machine")->group(kGroup);
}

}  // namespace mapkeep
