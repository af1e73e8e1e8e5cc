#include "commands.h"

namespace mr::apps {

void add_eval_features(CLI::App&, int&) {}

}  // namespace mr::apps
