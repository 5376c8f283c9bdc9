//! Cases of `relume form-factor`, as JSON; the few of few vertices are evaluated, too.
#![no_main]

use libfuzzer_sys::fuzz_target;
use relume_fuzz::within;
use relume_host::cli::read_cases;
use relume_host::polygon_pair::form_factor;

const MOST_VERTICES: usize = 12;

fuzz_target!(|bytes: &[u8]| {
    let Ok(cases) = within((1 << 16) + 512 * bytes.len(), || read_cases(bytes)) else {
        return;
    };
    for case in cases.iter().take(3) {
        let polygons = [&case.from, &case.to].into_iter().chain(&case.blockers);
        if polygons.map(|p| p.vertices().len()).sum::<usize>() <= MOST_VERTICES {
            let factor = form_factor(&case.from, &case.to, &case.blockers);
            assert!((0.0..=1.0).contains(&factor.value), "{factor:?}");
            assert!(factor.error >= 0.0, "{factor:?}");
        }
    }
});
