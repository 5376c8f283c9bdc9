# Sourced with a target triple: makes plain cargo build for that bare-metal target.
#
# Where rustup's toolchain has the target (`rustup target add TARGET`), nothing is needed. Elsewhere
# Debian's compiler, which comes with the sources of core, builds it; rustup's rust-lld links.
#
# With `--check` after the triple nothing is installed: the status tells whether the target can be built.
# With `all` instead of a triple, as root: installs the compiler, the emulator, the C toolchain and node.
target="${1:?a target triple, or all}"

relume_debian_rust() { [ -x /usr/bin/rustc ] && [ -d /usr/lib/rustlib/src/rust ]; }
relume_install() {
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

if [ "$target" = all ]; then
    relume_install qemu-system-arm binutils-arm-none-eabi gcc-arm-none-eabi libnewlib-arm-none-eabi nodejs
    relume_debian_rust || rustup target add thumbv6m-none-eabi thumbv7m-none-eabi thumbv7em-none-eabihf wasm32-unknown-unknown ||
        relume_install rustc-web rust-web-src
elif rustup target list --installed 2>/dev/null | grep -qx "$target"; then
    :
elif [ "${2:-}" = --check ]; then
    relume_debian_rust
else
    relume_debian_rust || relume_install rustc-web rust-web-src
    PATH="$(rustc --print sysroot)/lib/rustlib/x86_64-unknown-linux-gnu/bin:$PATH"
    export PATH RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1 CARGO_UNSTABLE_BUILD_STD=core
fi
