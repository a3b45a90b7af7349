// Reruns the paper's tables on data that whoever runs it has. The first option says which:
//
//   paper_tables --sessions DIR DIR    Table 1, on two sessions in any layout that the client reads
//   paper_tables --kth DIR...          Tables 2 and 3, on folders of the KTH dynamic-map benchmark

#include <cstdio>
#include <string>
#include <vector>

#include "tests/bench/paper_table_1.h"
#include "tests/bench/paper_table_2_3.h"

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() >= 2 && arguments[0] == "--kth") {
    return mapkeep::RunPaperTables2And3(std::span(arguments).subspan(1));
  }
  if (arguments.size() == 3 && arguments[0] == "--sessions") {
    return mapkeep::RunPaperTable1(std::span(arguments).subspan(1));
  }
  std::fputs("usage: paper_tables --sessions DIR DIR | --kth DIR...\n", stderr);
  return 2;
}
