"""Reasons and sources as people read them."""

from __future__ import annotations

from stereolib.measurement import Reason, Source, Why


def test_a_reason_says_what_was_seen_and_what_to_do():
    assert str(Why(Reason.LEANS, "by 7 degrees")) == "by 7 degrees: it leans; put it upright"
    assert str(Why(Reason.NO_FACE)) == "no straight face was found"
    assert Reason.NO_TEXTURE.short == "no texture" and Reason.TOP_CUT.short == "top cut"
    assert f"{Source.BOTH}" == "scan and image" and Source("scan") is Source.SCAN


def test_texts_tell_them_apart_and_begin_small():
    texts = [reason.value for reason in Reason]
    assert len(set(texts)) == len(texts)
    assert all(text == text.strip(" .") and text[0].islower() for text in texts)
