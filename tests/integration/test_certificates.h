#pragma once

#include <string>

namespace mapkeep {

/// A certificate authority and what it signs, made by openssl in a directory.
class TestCertificates {
 public:
  /// Makes the authority. Throws std::runtime_error if openssl fails.
  explicit TestCertificates(std::string directory);

  /// Makes NAME.pem and NAME.key for localhost and 127.0.0.1, valid for `days` from now; negative: expired by then.
  void Issue(const std::string& name, int days = 2) const;
  /// Another authority of the same name as `name`, and a certificate of it.
  void IssueByStranger(const std::string& name) const;

  std::string authority() const { return directory_ + "/ca.pem"; }
  std::string certificate(const std::string& name) const { return directory_ + "/" + name + ".pem"; }
  std::string key(const std::string& name) const { return directory_ + "/" + name + ".key"; }

 private:
  void MakeAuthority(const std::string& name) const;
  void Sign(const std::string& name, const std::string& authority, int days) const;

  const std::string directory_;
};

}  // namespace mapkeep
