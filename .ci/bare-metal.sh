# Sourced with a target triple: makes plain cargo build for that bare-metal target.
#
# Where rustup's toolchain has the target (`rustup target add TARGET`), nothing is needed. Elsewhere
# Debian's compiler, which comes with the sources of core, builds it; rustup's rust-lld links.
target="${1:?a target triple}"
if ! rustup target list --installed 2>/dev/null | grep -qx "$target"; then
    if [ ! -x /usr/bin/rustc ] || [ ! -d /usr/lib/rustlib/src ]; then
        apt-get update -qq
        apt-get install -y -qq rustc-web rust-web-src >/dev/null
    fi
    PATH="$(rustc --print sysroot)/lib/rustlib/x86_64-unknown-linux-gnu/bin:$PATH"
    export PATH RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1 CARGO_UNSTABLE_BUILD_STD=core
fi
