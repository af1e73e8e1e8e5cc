#include "mr/net/network_config.h"

#include <algorithm>

#include "mr/core/range.h"
#include "mr/core/user_text.h"
#include "mr/net/address.h"

namespace mr::net {

bool NatsConfig::is_user_nkey(std::string_view text) {
  return text.size() == 56 && text[0] == 'U' && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= 'A' && c <= 'Z') || (c >= '2' && c <= '7');
         });
}

std::vector<std::string> NatsConfig::problems() const {
  std::vector<std::string> out;
  if (!nkey.empty() && !is_user_nkey(nkey))
    out.push_back("nkey must be the public NKey of a user, U and 55 more letters or digits");
  if (nkey.empty() != nkey_seed.empty()) out.push_back("nkey needs its seed, and a seed its nkey");
  if (certificate.empty() != key.empty())
    out.push_back("cert and key only together; both are PEM files");
  if (!nkey.empty() && !credentials.empty()) out.push_back("either nkey or credentials, not both");
  const bool has_tls_files = !ca.empty() || !certificate.empty();
  if (has_tls_files && !url.empty() && url.find("tls://") == std::string::npos)
    out.push_back("ca, cert and key need tls:// in the url; nats:// is not encrypted");
  return out;
}

std::vector<std::string> NetworkConfig::problems() const {
  std::vector<std::string> out = prefixed("nats: ", nats.problems());
  for (const auto& [node, address] : tcp)
    if (!is_address(address))
      out.push_back("tcp: " + node + ": " + in_quotes(address) +
                    " is no address; write host:port, as in 127.0.0.1:8080");
  return out;
}

}  // namespace mr::net
