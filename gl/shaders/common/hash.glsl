// Integer hashes: random numbers that are a function of what they are for.

// Finalizer of Wellons, "lowbias32".
uint hash(uint x) {
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}
