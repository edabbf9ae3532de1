/* Client of the taxel protocol: include this header, or the single headers. C++17, header-only, no dependencies. */
#ifndef TAXEL_CLIENT_TAXEL_HPP
#define TAXEL_CLIENT_TAXEL_HPP

#include "taxel/capture.hpp"
#include "taxel/decoder.hpp"
#include "taxel/original.hpp"

#endif
