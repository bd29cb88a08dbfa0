// The methods: X(identifier, name on the command line), each defined as `const gonio_fit_method
// gonio_method_<identifier>`. The default method is "auto" where it is registered, else the first.
#define GONIO_FIT_METHODS(X)                                                                                           \
    X(mba, "mba")                                                                                                      \
    X(cbmba, "cbmba")                                                                                                  \
    X(lsq, "lsq")                                                                                                      \
    X(auto, "auto")                                                                                                    \
    X(cook_torrance, "cook-torrance")                                                                                  \
    X(ggx, "ggx")
