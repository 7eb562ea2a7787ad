//! The reference of 192 bits itself.

use holonomy::{
    geometry::GEOMETRIES,
    measure::reference::{Big, model},
};

#[test]
fn reference_covers_every_geometry() {
    for entry in GEOMETRIES {
        assert!(model(entry.id).is_some(), "{} has no reference", entry.name);
    }
}

#[test]
fn reference_numbers_hold_fifty_digits() {
    let x = Big::parse("1.4142135623730950488016887242096980785696718753769480731766797379");
    let defect = &(&x * &x) - &Big::new(2.0);
    assert!(defect.to_f64().abs() < 1e-55, "{defect:?}");
    let (s, c) = Big::new(1000.0).sin_cos();
    assert!((&(&(&s * &s) + &(&c * &c)) - &Big::new(1.0)).to_f64().abs() < 1e-55);
    assert!((s.to_f64() - 0.826_879_540_532_003).abs() < 1e-15);
}

#[test]
fn reference_numbers_are_what_they_are_made_from() {
    for (x, text) in [(1e-310, "1e-310"), (f64::from_bits(1), "4.9406564584124654e-324"), (-1.5e-320, "-1.5e-320")] {
        let off = &Big::new(x) - &Big::parse(text);
        // Subnormal numbers have few digits; half of the last one is 2.5e-324.
        let scaled = &off * &Big::parse("1e324");
        assert!(scaled.to_f64().abs() < 2.5, "{x:e}: {scaled:?}");
        assert_eq!(Big::new(x).to_f64(), x);
    }
}
