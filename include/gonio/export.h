// SPDX-License-Identifier: BSD-3-Clause
// What the libraries export: every function that a public header declares, and nothing else.
//
// The libraries are compiled with hidden visibility. Between GONIO_BEGIN and GONIO_END it is the default one, so a
// declaration in a public header is all that a public function needs; both C and C++ link with it.
#ifndef GONIO_EXPORT_H
#define GONIO_EXPORT_H

// clang-format off
#ifdef __cplusplus
#define GONIO_BEGIN extern "C" { _Pragma("GCC visibility push(default)")
#define GONIO_END _Pragma("GCC visibility pop") }
#else
#define GONIO_BEGIN _Pragma("GCC visibility push(default)")
#define GONIO_END _Pragma("GCC visibility pop")
#endif
// clang-format on

#endif
