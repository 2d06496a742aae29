#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "catch_shim.hpp"
#include "numbers/numbers.hpp"
#include "numbers/reading.hpp"

using namespace numbers_test;

namespace {

template <class T>
void check_type(const std::string& type, const std::vector<T>& values) {
  Values expected;
  for (const T& x : values) expected.push_back(static_cast<double>(x));
  const std::string shape = "(" + std::to_string(values.size()) + ",)";
  INFO(type);
  CHECK(values_of(npy(dict("'<" + type + "'", shape), bytes_of(values))) == expected);
  CHECK(values_of(npy(dict("'>" + type + "'", shape), bytes_of(values, true))) == expected);
}

}  // namespace

TEST_CASE("every real type of NumPy, in both byte orders", "[numbers][exact]") {
  check_type<double>("f8", {0.5, -2, 1e300});
  check_type<float>("f4", {0.5F, -2, 1e30F});
  check_type<std::int8_t>("i1", {0, -128, 127});
  check_type<std::uint8_t>("u1", {0, 255});
  check_type<std::int16_t>("i2", {-32768, 32767});
  check_type<std::uint16_t>("u2", {65535});
  check_type<std::int32_t>("i4", {-2147483647 - 1, 2147483647});
  check_type<std::uint32_t>("u4", {4294967295U});
  check_type<std::int64_t>("i8", {-(std::int64_t{1} << 53), std::int64_t{1} << 53});
  check_type<std::uint64_t>("u8", {std::uint64_t{1} << 53});
  CHECK(values_of(npy(dict("'|b1'", "(3,)"), "\1\0\1"s)) == Values{1, 0, 1});
  CHECK(values_of(npy(dict("'|i1'", "(2,)"), "\xff\1")) == Values{-1, 1});
  // half precision: 1, -2, 65504, 2^-24, infinity
  const std::vector<std::uint16_t> halves = {0x3c00, 0xc000, 0x7bff, 0x0001, 0x7c00, 0x3555};
  const Values expected = {1, -2, 65504, std::ldexp(1, -24), std::numeric_limits<double>::infinity(), 0.333251953125};
  CHECK(values_of(npy(dict("'<f2'", "(6,)"), bytes_of(halves))) == expected);
  CHECK(values_of(npy(dict("'>f2'", "(6,)"), bytes_of(halves, true))) == expected);
  const Read large = read_bytes(npy(dict("'<i8'", "(1,)"), bytes_of<std::int64_t>({(std::int64_t{1} << 53) + 1})));
  CHECK(doubts(large, Cause::rounded));
}

TEST_CASE("shapes and orders of .npy, and its versions", "[numbers][exact]") {
  const std::string six = bytes_of<double>({1, 2, 3, 4, 5, 6});
  CHECK(values_of(npy(dict("'<f8'", "()"), bytes_of<double>({7}))) == Values{7});
  CHECK(values_of(npy(dict("'<f8'", "(6, 1)"), six)) == Values{1, 2, 3, 4, 5, 6});
  CHECK(values_of(npy(dict("'<f8'", "(3, 2)"), six), column("1")) == Values{1, 3, 5});
  CHECK(values_of(npy(dict("'<f8'", "(3, 2)"), six), column("2")) == Values{2, 4, 6});
  CHECK(values_of(npy(dict("'<f8'", "(3, 2)", true), six), column("1")) == Values{1, 2, 3});
  CHECK(values_of(npy(dict("'<f8'", "(3, 2)", true), six), column("2")) == Values{4, 5, 6});
  CHECK(read_bytes(npy(dict("'<f8'", "(3, 2)"), six)).refused == Cause::array_column);
  CHECK(read_bytes(npy(dict("'<f8'", "(3, 2)"), six), column("3")).refused == Cause::array_column);
  CHECK(read_bytes(npy(dict("'<f8'", "(3, 2)"), six), column("x")).refused == Cause::array_column);
  CHECK(read_bytes(npy(dict("'<f8'", "(3, 2, 1)"), six)).refused == Cause::unsupported);
  CHECK(values_of(npy(dict("'<f8'", "(0,)"), "")).empty());
  for (const int version : {1, 2, 3}) CHECK(values_of(npy(dict("'<f8'", "(6,)"), six, version)).size() == 6);
  CHECK(read_bytes(npy(dict("'<f8'", "(6,)"), six, 4)).refused == Cause::corrupt);
  std::string many;
  for (int i = 0; i < 300000; ++i) many += bytes_of<double>({i + 0.5, -1.0});
  const Read wide = read_bytes(npy(dict("'<f8'", "(300000, 2)"), many), column("1"));
  CHECK(wide.values.size() == 300000);
  CHECK(wide.values.back() == 299999.5);
}

TEST_CASE("records of .npy are columns by name", "[numbers][exact]") {
  const std::string type = "[('id', '<i4'), ('x', '<f8'), ('tag', '<U2'), ('', '|V3'), ('v', '<f4', (2,))]";
  std::string data;
  for (const int i : {1, 2}) {
    data +=
        bytes_of<std::int32_t>({i}) + bytes_of<double>({i + 0.5}) + std::string(8 + 3, 'x') + bytes_of<float>({1, 2});
  }
  const std::string file = npy(dict(type, "(2,)"), data);
  CHECK(values_of(file, column("x")) == Values{1.5, 2.5});
  CHECK(values_of(file, column("id")) == Values{1, 2});
  CHECK(values_of(file, column("2")) == Values{1.5, 2.5});
  CHECK(read_bytes(file).refused == Cause::which_column);
  CHECK(read_bytes(file, column("tag")).refused == Cause::unsupported);
  CHECK(read_bytes(file, column("v")).refused == Cause::unsupported);
  CHECK(read_bytes(npy(dict("[('a', [('b', '<f8')])]", "(1,)"), data), column("a")).refused == Cause::unsupported);
}

TEST_CASE("what .npy holds and is no real number is refused by name", "[numbers][exact]") {
  for (const auto& [type, word] : std::vector<std::pair<std::string, std::string>>{{"<c16", "complex"},
                                                                                   {"<c8", "complex"},
                                                                                   {"<U5", "strings"},
                                                                                   {"|S3", "strings"},
                                                                                   {"<M8[ns]", "dates"},
                                                                                   {"|O8", "objects"},
                                                                                   {"<f16", "long doubles"},
                                                                                   {"|V4", "raw bytes"},
                                                                                   {"<i3", "<i3"},
                                                                                   {"<q8", "<q8"}}) {
    const Read r = read_bytes(npy(dict("'" + type + "'", "(1,)"), std::string(32, '\0')));
    INFO(type << " " << r.why);
    CHECK((r.refused == Cause::unsupported || r.refused == Cause::complex));
    CHECK(r.why.find(word) != std::string::npos);
  }
}

TEST_CASE("a .npy that claims what is not there is refused, and takes no memory", "[numbers][exact]") {
  const std::string two = bytes_of<double>({1, 2});
  for (const std::string shape : {"(3,)", "(4611686018427387904,)", "(1000000000000,)", "(9223372036854775807, 1)",
                                  "(4294967296, 4294967296)", "(18446744073709551615,)"}) {
    INFO(shape);
    CHECK(read_bytes(npy(dict("'<f8'", shape), two), column("1")).refused == Cause::corrupt);
    CHECK(read_bytes(npy(dict("'<f8'", shape, true), two), column("1")).refused == Cause::corrupt);
  }
  CHECK(read_bytes(npy(dict("'<f8'", "(1,)"), two)).refused == Cause::corrupt);  // more than it says
  for (const std::string broken : {"", "{", "{'descr': '<f8'}", "{'descr': '<f8', 'fortran_order': No, 'shape': (2,)}",
                                   "{'descr': '<f8', 'fortran_order': False, 'shape': (-2,)}",
                                   "{'descr': '<f8', 'fortran_order': False, 'shape': (2,)} x",
                                   "{'descr': [('a', '<f8', (99999999999, 99999999999))], 'fortran_order': False, "
                                   "'shape': (2,)}"}) {
    INFO(broken);
    CHECK(read_bytes(npy(broken, two)).refused.has_value());
  }
  const std::string good = npy(dict("'<f8'", "(2,)"), two);
  for (std::size_t n = 6; n < good.size(); ++n) {
    CHECK(read_bytes(std::string_view(good).substr(0, n), raw(Format::npy)).refused == Cause::corrupt);
  }
  CHECK(read_bytes("\x93NUMPY\2\0\xff\xff\xff\xff{}"s).refused == Cause::corrupt);
  CHECK(read_bytes("1\n2\n", raw(Format::npy)).refused == Cause::corrupt);
}
